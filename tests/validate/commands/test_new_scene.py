"""`run_sweep.py new-scene`: the files it writes load, explain every key of the schema, and overwrite nothing."""

from __future__ import annotations

import re

import pytest

import scenes
from pss import RangeError
from render.store.folder import StoreError
from scenes import load_sweep
from scenes.schema.scene_tables import SceneSpec
from scenes.steps.sweep_file import SweepSpec
from validate.commands.new_scene import write_new_scene
from validate.run_sweep import main


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A new scene and its sweep."""
    return write_new_scene("attic", tmp_path_factory.mktemp("new"))


def keys_of(model):
    """Every dotted key of a file, read off pydantic's own JSON schema and not off our walk through the tables."""
    schema = model.model_json_schema(by_alias=True)

    def below(node, prefix):
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        for key, child in node.get("properties", {}).items():
            yield prefix + key
            yield from below(child, f"{prefix}{key}.")
        for part in ("anyOf", "oneOf", "prefixItems"):
            for child in node.get(part, ()):
                yield from below(child, prefix)
        if isinstance(node.get("items"), dict):
            yield from below(node["items"], prefix)

    return set(below(schema, ""))


def test_the_files_load_and_belong_together(written):
    """The sweep finds the scene beside it, and every step has cameras that the scene has."""
    scene_path, sweep_path = written
    scene, sweep = scenes.load(scene_path), load_sweep(sweep_path)
    assert len(scene.cameras) == 5
    assert sweep.scene_path == scene_path
    assert [step.label for step in sweep.configurations(scene)] == ["1+2", "1+3", "1+4", "1+5"]
    assert not scene.warnings


@pytest.mark.parametrize(("number", "model"), [(0, SceneSpec), (1, SweepSpec)], ids=["scene", "sweep"])
def test_comments_name_every_key_of_the_schema(written, number, model):
    """And no key that the schema has not."""
    comments = re.findall(r"^# ([a-z][\w.]*)  +\S|^# ([a-z][\w.]*\.\w+) \S", written[number].read_text(), re.MULTILINE)
    named = {first or second for first, second in comments}
    tables = set(re.findall(r"^# \[([\w.]+)\]", written[number].read_text(), re.MULTILINE))
    keys = keys_of(model)
    assert len(keys) > 10
    assert keys <= named | tables, keys - named - tables
    assert {name for name in named if "." in name} | tables <= keys


def test_the_commented_example_of_a_setting_is_a_sweep(written, tmp_path):
    """What the sweep's comments offer instead works when it is taken out of the comments."""
    scene_path, sweep_path = written
    text = sweep_path.read_text()
    offered = re.search(r"^# \[vary\]\n(?:# \w.*\n)+", text, re.MULTILINE).group().replace("# ", "")
    changed = scene_path.with_name("other-sweep.toml")
    changed.write_text(re.sub(r"^\[vary\]\D[\s\S]*?\n\n", offered + "\n", text, count=1, flags=re.MULTILINE))
    steps = load_sweep(changed).configurations(scenes.load(scene_path))
    assert [step.label for step in steps] == ["zoom=1", "zoom=1.5", "zoom=2", "zoom=3"]


def test_nothing_is_overwritten(tmp_path):
    """Either file in the way stops both."""
    (tmp_path / "mine-sweep.toml").write_text("mine")
    with pytest.raises(StoreError, match="mine-sweep"):
        write_new_scene("mine", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine-sweep.toml"]
    assert (tmp_path / "mine-sweep.toml").read_text() == "mine"


@pytest.mark.parametrize("name", ["", "a/b", "..", "a b", "x" * 61, "-x", "ä"])
def test_a_name_is_no_path(tmp_path, name):
    """Names that could lead elsewhere, or be no file's name, are refused with the value."""
    with pytest.raises(RangeError, match="allowed"):
        write_new_scene(name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_command_says_what_to_do_next(tmp_path, capsys):
    """The two commands that follow, with the files' own names."""
    assert main(["new-scene", "loft", "--out", str(tmp_path)]) == 0
    output = capsys.readouterr().out
    assert f"check {tmp_path / 'loft.toml'}" in output
    assert f"run_sweep.py {tmp_path / 'loft-sweep.toml'}" in output
