"""TOML as text: what is written is read again as the same document, by Python's own reader."""

from __future__ import annotations

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pss.toml_text import toml_text

SINGLE = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"]))
)
KEYS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
VALUES = st.recursive(SINGLE, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3))


@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_a_document_is_read_again_as_it_was(document):
    assert tomllib.loads(toml_text(document)) == document


def test_tables_are_written_as_people_write_them():
    document = {
        "lens": {"f_number": 1.8, "radial_distortion": (0.0, -0.1)},
        "name": 'a "name"',
        "cameras": [{"name": "left"}, {"name": "right", "markers": {"rows": 2}}],
        "light": {"panels": [{"centre_m": [0.0, 1.0]}], "on": True},
    }
    assert toml_text(document) == (
        'name = "a \\"name\\""\n\n'
        "[lens]\nf_number = 1.8\nradial_distortion = [0.0, -0.1]\n\n"
        '[[cameras]]\nname = "left"\n\n[[cameras]]\nname = "right"\nmarkers = { rows = 2 }\n\n'
        "[light]\npanels = [\n  { centre_m = [0.0, 1.0] },\n]\non = true\n"
    )


def test_what_toml_has_no_place_for_is_refused():
    with pytest.raises(TypeError, match="NoneType has no place in TOML"):
        toml_text({"a": None})
