"""JSON that the project writes is JSON for every reader: no NaN, no Infinity."""

from __future__ import annotations

import dataclasses
import math

import OpenImageIO as oiio
import pytest

from pss import RangeError
from pss.json_text import as_json, json_text
from render.certificate import Certificate
from render.files.exr import read_view, write_view
from render.store.checksums import sum_path
from render.store.folder import Store
from render.store.views import certificate_of, load_view, save_view
from tests.helpers.strict_json import strict
from tests.helpers.views import an_awkward_view
from validate.runs.events import EVENTS, EventFile


def test_numbers_that_json_lacks_are_null():
    """At any depth, in lists, tuples and tables; the rest stays bit for bit."""
    content = {"a": [1.5, math.nan, (math.inf, {"b": -math.inf, "c": 0.1 + 0.2})], "d": "NaN", "e": None, "f": True}
    found = strict(json_text(content))
    assert found == {"a": [1.5, None, [None, {"b": None, "c": 0.1 + 0.2}]], "d": "NaN", "e": None, "f": True}
    assert as_json(content) == found
    assert json_text({"b": 1, "a": "é"}, sort_keys=True, ensure_ascii=False) == '{"a": "é", "b": 1}'


def test_what_is_no_data_is_refused():
    with pytest.raises(TypeError):
        json_text({"a": object(), "b": math.nan})


WITHOUT_EDGES = Certificate(math.nan, math.nan, math.nan, 0.1, 0.2, 1000, 0.0)


def test_a_view_without_edges_of_markers_is_stored_as_json(tmp_path):
    """Header and checksum file; what is read back is nan again."""
    request, view = an_awkward_view()
    view = dataclasses.replace(view, certificate=WITHOUT_EDGES)
    write_view(tmp_path / "view.exr", view, request)
    spec = oiio.ImageBuf(str(tmp_path / "view.exr")).spec()
    texts = {item.name: item.value for item in spec.extra_attribs if item.name.startswith("pss:")}
    assert strict(texts["pss:certificate"])["edge_rms"] is None
    for name, text in texts.items():
        if name != "pss:key":
            strict(text)
    assert math.isnan(read_view(tmp_path / "view.exr").certificate.edge_p999)

    store = Store(tmp_path / "store")
    save_view(store, view, request, 1.5)
    content = sum_path(store.view(request.key)).read_text().rpartition(" ")[0]
    assert strict(content)["facts"]["certificate"]["edge_rms"] is None
    for found in (certificate_of(store, request), load_view(store, request.key).certificate):
        assert math.isnan(found.edge_rms)
        assert dataclasses.astuple(found)[3:] == dataclasses.astuple(WITHOUT_EDGES)[3:]


def test_events_are_json(tmp_path):
    EventFile(tmp_path, lambda line: None).write("measured", seconds=math.nan)
    assert strict((tmp_path / EVENTS).read_text())["seconds"] is None


@pytest.mark.parametrize("content", [None, [], {}, {"edge_rms": 1.0}, "x"])
def test_a_certificate_of_other_keys_is_refused(content):
    with pytest.raises(RangeError, match="allowed: edge_rms"):
        Certificate.from_json(content)


@pytest.mark.parametrize("value", ["1", True, [1.0], {}])
def test_a_certificate_of_what_is_no_number_is_refused(value):
    with pytest.raises(RangeError, match="allowed: a number, or null"):
        Certificate.from_json(dataclasses.asdict(WITHOUT_EDGES) | {"samples": value})
