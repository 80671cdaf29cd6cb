"""The table of metrics: names, directions, and what entry points of other packages bring."""

import importlib.metadata
import math
import warnings

import pytest

from pss import METRICS, PTZCamera, RangeError, evaluate
from pss.metric.table import ENTRY_POINTS, STATUS_MEANING, Metric, MetricTable
from tests.helpers.entry_points import Entry

CAMERAS = [PTZCamera((x, -4, 1), 0, 0).aimed_at((0, 0, 1)) for x in (-2, 2)]
POINTS, NORMALS = [[0, 0, 1], [0.1, 0, 1]], [[0, -1, 0]] * 2


def metric(name, value=1.0, higher_is_better=True):
    return Metric(name, lambda evaluation: value, higher_is_better, "a test")


@pytest.fixture
def installed(monkeypatch):
    """Installs entries; the list is filled by the test."""
    entries = []

    def entry_points(*, group):
        assert group == ENTRY_POINTS == "pss.metrics"
        return tuple(entries)

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
    return entries


def test_entry_points_join_the_table(installed):
    installed += [Entry("one", metric("theirs", 3.0)), Entry("more", [metric("a"), metric("b")])]
    table = MetricTable([metric("ours")])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert list(table) == ["ours", "theirs", "a", "b"]
    assert len(table) == 4
    assert table["theirs"].score(None) == 3.0


def test_a_broken_entry_warns_and_takes_no_other_along(installed):
    """One that doesn't import, a name that is taken, something that is no metric: the rest is there, ours unchanged."""
    installed += [
        Entry("broken", ImportError("no such module")),
        Entry("duplicate", metric("ours", 99.0)),
        Entry("number", 42),
        Entry("mixed", [metric("before"), "not a metric", metric("behind")]),
        Entry("good", metric("good", 7.0)),
    ]
    table = MetricTable([metric("ours", 1.0)])
    with pytest.warns(UserWarning, match="metrics of entry point") as caught:
        names = list(table)
    assert names == ["ours", "before", "good"]
    assert table["ours"].score(None) == 1.0
    assert table["good"].score(None) == 7.0
    messages = [str(warning.message) for warning in caught]
    assert len(messages) == 4
    for message, (entry, reason) in zip(
        messages,
        [
            ("broken", "no such module"),
            ("duplicate", "'ours' is there already; allowed: another name"),
            ("number", "not iterable"),
            ("mixed", "'not a metric'; allowed: a pss.Metric"),
        ],
        strict=True,
    ):
        assert message.startswith(f"metrics of entry point {entry!r} (elsewhere:{entry}): ")
        assert reason in message


def test_entries_are_looked_for_when_needed_and_once(installed):
    """A control loop that asks for PSS by name does not wait for what else is installed."""
    entry = Entry("late", metric("late"))
    installed.append(entry)
    table = MetricTable([metric("ours")])
    assert table["ours"].name == "ours"
    assert entry.loaded == 0
    assert table["late"].name == "late"
    assert list(table) == ["ours", "late"]
    with pytest.raises(KeyError, match="metric 'absent'; allowed: ours, late"):
        table["absent"]
    assert entry.loaded == 1


def test_better_follows_the_direction():
    table = MetricTable([metric("up"), metric("down", higher_is_better=False)])
    assert table.better("up", 2, 1)
    assert not table.better("up", 1, 1)
    assert table.better("down", 1, 2)
    assert table.better("down", 1, math.inf)
    assert not table.better("down", math.inf, math.inf)


def test_two_metrics_of_one_name_are_refused():
    with pytest.raises(RangeError, match="one name"):
        MetricTable([metric("same"), metric("same")])


def test_a_metric_can_be_called_with_what_evaluate_takes():
    for noise in ("as-printed", "identity"):
        expected = evaluate(CAMERAS, POINTS, NORMALS, noise=noise).pss
        assert METRICS["pss"](CAMERAS, POINTS, NORMALS, noise=noise) == expected > 0


def test_every_metric_says_where_it_comes_from():
    assert len(METRICS) == len({m.name for m in METRICS.values()})
    for name, entry in METRICS.items():
        assert entry.name == name
        assert entry.reference
        assert entry.unobservable
        assert entry.status in STATUS_MEANING
        if entry.status == "after":
            assert entry.reference.startswith("after ")
