"""What is derived from a result is computed once, for each result and each set of arguments."""

from __future__ import annotations

from types import SimpleNamespace

from validate.sweeps.derived import derived

CALLS = []


@derived
def scaled(result, factor, offset=0):
    CALLS.append((result.value, factor, offset))
    return [result.value * factor + offset]


def test_each_result_and_set_of_arguments_once():
    CALLS.clear()
    one, other = SimpleNamespace(value=2), SimpleNamespace(value=3)
    assert scaled(one, 5) is scaled(one, factor=5) is scaled(one, 5, 0)
    assert scaled(one, 5, offset=1) == [11]
    assert scaled(other, 5) == [15]
    assert CALLS == [(2, 5, 0), (2, 5, 1), (3, 5, 0)]
