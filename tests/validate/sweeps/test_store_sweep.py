"""The campaign at full length (`make acceptance`): a sweep whose every stored file is damaged in each way in turn."""

from __future__ import annotations

import os
import shutil

import pytest

from tests.helpers.closet import ALONE, DETERMINED, SCENE
from tests.helpers.stored_views import WAYS, damaged, stored
from validate.run_sweep import main

pytestmark = [pytest.mark.render, pytest.mark.acceptance]


@pytest.fixture(scope="module")
def closet(tmp_path_factory):
    """A folder with a sweep of two views, and its finished first run."""
    folder = tmp_path_factory.mktemp("campaign")
    for name, text in (("closet", SCENE), ("alone", ALONE)):
        (folder / f"{name}.toml").write_text(text)
    assert run(folder, "store", "first") == 0
    return folder


def run(folder, store, out):
    """Run the sweep in this process, and give its exit code."""
    return main([str(folder / "alone.toml"), "--store", str(folder / store), "--out", str(folder / out)])


@pytest.mark.parametrize("rotten", [False, True], ids=["changed", "rotten"])
@pytest.mark.parametrize("way", WAYS)
def test_every_file_damaged_in_turn_leaves_the_tables_as_they_were(closet, way, rotten, caplog, capsys):
    """By another program, or by a disk that turns bits and no clock: then `store verify` finds it before the run."""
    files = stored(closet / "store")
    assert len(files) == 2 * (2 + 1 + 2)
    for number, file in enumerate(files):
        name = f"{way}-{rotten}-{number}"
        store = closet / name
        shutil.copytree(closet / "store", store)
        path = store / file.relative_to(closet / "store")
        bytes_now = damaged(path.read_bytes(), way)
        path.write_bytes(bytes_now)
        if rotten:
            status = file.stat()
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
            assert main(["store", "verify", "--store", str(store)]) == 1
        caplog.clear()
        assert run(closet, name, f"out-{name}") == 0
        assert len(caplog.messages) == (not rotten)
        aside = store / "damaged" / path.relative_to(store)
        assert aside.read_bytes() == bytes_now
        assert ("1 rendered" in capsys.readouterr().out) == ("views" in path.parts)
        for table in DETERMINED:
            assert (closet / "first" / table).read_bytes() == (closet / f"out-{name}" / table).read_bytes(), (
                path,
                table,
            )
        assert main(["store", "verify", "--store", str(store)]) == 0
        shutil.rmtree(store)


def test_views_that_rot_are_found_by_the_contact_sheet_and_rendered_again(closet, caplog):
    """Nothing else of a repeated run looks at pixels."""
    shutil.copytree(closet / "store", closet / "sheet")
    for path in (closet / "sheet" / "views").rglob("*.exr"):
        status = path.stat()
        path.write_bytes(damaged(path.read_bytes(), "flipped"))
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert run(closet, "sheet", "sheet-out") == 0
    assert len(caplog.messages) == 2
    for table in DETERMINED:
        assert (closet / "first" / table).read_bytes() == (closet / "sheet-out" / table).read_bytes(), table
    assert main(["store", "verify", "--store", str(closet / "sheet")]) == 0
