"""A campaign: mutated files, each read in a process whose memory and time are limited; what then happened to them.

    python -m tests.helpers.fuzzing KIND SEED FIRST COUNT FOLDER

reads the files FIRST to COUNT of a campaign and prints two lines of JSON for each, so that whoever started it knows
which file it was that ended it.
"""

from __future__ import annotations

import json
import resource
import shutil
import signal
import subprocess
import sys
import tomllib
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.helpers.mutations import as_toml, chosen, mutated_bytes, mutated_document, written
from tests.helpers.processes import environment

ROOT = Path(__file__).parents[2]
# Reading takes far below a second of processor time, and below a hundred megabytes.
LONGEST_CPU_S = 20
# Without using the processor, as on a pipe that nobody writes to; far beyond what a busy machine makes of a second.
LONGEST_WALL_S = 240
MOST_MEMORY = 2 * 2**30
# Of a line of an error: values are shortened to 70 characters, and what is allowed is a list of keys.
LONGEST_LINE = 3000

Made = tuple[str, bytes, str]


# ---- files, by kind: (name, content, what was done) ------------------------------------------------------------------


def _toml(files: list[Path], rng: np.random.Generator) -> tuple[Path, bytes, str]:
    file = chosen(rng, files)
    if rng.random() < 0.25:
        content, change = mutated_bytes(file.read_bytes(), rng)
    else:
        document, change = mutated_document(tomllib.loads(file.read_text(encoding="utf-8")), rng)
        content = as_toml(document)
    return file, content, f"{file.relative_to(ROOT).as_posix()}: {change}"


def a_scene(rng: np.random.Generator, _folder: Path) -> Made:
    _, content, change = _toml(sorted((ROOT / "scenes").glob("*.toml")), rng)
    return "scene.toml", content, change


def a_sweep(rng: np.random.Generator, _folder: Path) -> Made:
    files = sorted((ROOT / "scenes").glob("sweeps/*.toml")) + sorted((ROOT / "scenes").glob("schedules/*.toml")) * 3
    file, content, change = _toml(files, rng)
    return f"{file.parent.name}/fuzzed.toml", content, change


def a_calibration(rng: np.random.Generator, _folder: Path) -> Made:
    _, content, change = _toml(sorted((ROOT / "results" / "reference").glob("bank*/calibrated.toml")), rng)
    return "calibrated.toml", content, change


def a_mesh(rng: np.random.Generator, folder: Path) -> Made:
    file = folder / "base" / f"crate.{chosen(rng, ('stl', 'ply', 'obj', 'off', 'glb', 'ascii.stl', 'ascii.ply'))}"
    content = file.read_bytes()
    suffix = file.suffix
    if suffix == ".glb" and rng.random() < 0.6:
        length = int.from_bytes(content[12:16], "little")
        document, change = mutated_document(json.loads(content[20 : 20 + length]), rng)
        text = written(document, ":").encode()
        text += b" " * (-len(text) % 4)
        rest = content[20 + length :]
        head = b"glTF" + np.array([2, 20 + len(text) + len(rest), len(text), 0x4E4F534A], "<u4").tobytes()
        content = head + text + rest
    else:
        content, change = mutated_bytes(content, rng, chosen(rng, (None, 400)))
    return f"crate{suffix}", content, f"{file.name}: {change}"


def a_backdrop(rng: np.random.Generator, _folder: Path) -> Made:
    content, change = mutated_bytes((ROOT / "scenes" / "workshop" / "shelves.xml").read_bytes(), rng)
    return "shelves.xml", content, change


def a_view(rng: np.random.Generator, folder: Path) -> Made:
    content = (folder / "base" / "view.exr").read_bytes()
    what = chosen(rng, ("bytes", "header", "window", "attribute", "attribute"))
    if what == "window":
        start = content.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
        window = rng.choice([0, 1, -5, 22, 36, 1000, 60_000, 2**31 - 1, -(2**31)], size=4).astype("<i4")
        return "view.exr", content[:start] + window.tobytes() + content[start + 16 :], f"data window {window.tolist()}"
    if what == "attribute":
        import OpenImageIO as oiio

        buffer = oiio.ImageBuf(str(folder / "base" / "view.exr"))
        names = [item.name for item in buffer.spec().extra_attribs if item.name.startswith("pss:")]
        name = chosen(rng, ("pss:camera", "pss:sensor", "pss:certificate", chosen(rng, names)))
        text = buffer.spec().get_string_attribute(name)
        try:
            document, change = mutated_document(json.loads(text), rng)
            text = written(document, ":")
        except (ValueError, TypeError):
            change, text = "no text", ""
        buffer.specmod().attribute(name, text)
        buffer.write(str(folder / "changed.exr"))
        return "view.exr", (folder / "changed.exr").read_bytes(), f"{name}: {change}"
    content, change = mutated_bytes(content, rng, 2000 if what == "header" else None)
    return "view.exr", content, change


def an_archive(rng: np.random.Generator, folder: Path) -> Made:
    content, change = mutated_bytes((folder / "base" / "light.npz").read_bytes(), rng)
    return "light.npz", content, change


def a_table(rng: np.random.Generator, _folder: Path) -> Made:
    file = chosen(rng, sorted((ROOT / "results" / "reference").glob("c*.csv")))
    content, change = mutated_bytes(file.read_bytes(), rng, chosen(rng, (None, 400)))
    return "configurations.csv", content, f"{file.name}: {change}"


A_RUN = {
    "options": {"store": "results/store", "set": "('lens.f_number=2',)", "sweeps": "('zoom',)", "trials": "None"},
    "sweeps": {"zoom": {"trials": 20, "values": [1.0, 2.5]}},
    "scenes": {"zoom": {"room": {"width_m": 6.0}, "cameras": [{"name": "1"}]}},
    "failed": {},
}


def a_run_file(rng: np.random.Generator, _folder: Path) -> Made:
    if rng.random() < 0.4:
        content, change = mutated_bytes(json.dumps(A_RUN).encode(), rng)
        return "run.json", content, change
    document, change = mutated_document(A_RUN, rng)
    return "run.json", written(document, ":").encode(), change


def a_fault(rng: np.random.Generator, _folder: Path) -> Made:
    return "fault.txt", b"", "nothing"


# ---- readers: each gives a valid object, or raises one of the project's own exceptions -------------------------------


def read_scene(path: Path) -> None:
    import scenes

    scene = scenes.load(path)
    json.dumps(scene.resolved(), allow_nan=False)
    for camera in scene.cameras:
        assert np.isfinite(camera.rotation).all()
    for marker in scene.state.markers:
        assert np.isfinite(marker.centre_m).all()


@lru_cache(maxsize=16)
def _shipped(path: Path) -> Any:
    import scenes

    return scenes.load(path)


def read_sweep(path: Path) -> None:
    from scenes import load_sweep
    from scenes.steps.schedule_file import load_schedule
    from validate.schedule.stage import stage_of

    if path.parent.name == "schedules":
        schedule = load_schedule(path)
        json.dumps(schedule.resolved(), allow_nan=False)
        stage_of(schedule, _shipped(schedule.scene_path))
        return
    sweep = load_sweep(path)
    json.dumps(sweep.resolved(), allow_nan=False)
    assert sweep.configurations(_shipped(sweep.scene_path))


def read_calibration(path: Path) -> None:
    from pss.noise.calibrated import Calibration

    read = Calibration.from_file(path)
    read.factors()
    again = path.with_name("again.toml")
    again.write_text(read.to_toml(), encoding="utf-8")
    assert Calibration.from_file(again).to_toml() == read.to_toml()


def read_mesh(path: Path) -> None:
    from pss.surrogates import Mesh

    assert np.isfinite(Mesh.from_file(path).face_areas_m2).all()


def read_xml(path: Path) -> None:
    from render.world.backdrop import read_backdrop

    for part in read_backdrop(path, within=path.parent).parts:
        assert np.isfinite(part.shape.vertices_m).all()
        assert 0 <= part.albedo <= 1


def read_exr(path: Path) -> None:
    from render.files.exr import read_view

    view = read_view(path)
    assert view.radiance.shape == view.camera.resolution[::-1]


def read_archive(path: Path) -> None:
    from pss import PSSError
    from render.store.folder import Store

    if Store(path.parent).load(path) is None:
        raise PSSError("nothing whole")


def read_table(path: Path) -> None:
    from validate.pages.columns import Columns
    from validate.runs.csv_file import number_in, read_csv, read_head

    rows = read_csv(path)
    assert len(read_head(path)) >= 1
    if rows:
        assert all(len(row) == len(rows[0]) for row in rows)
        number_in(rows[0], "value" if "value" in rows[0] else "spearman")
        for column in ("pss", "spearman", "value", "rms_m"):
            if column in rows[0]:
                assert Columns(rows, (len(rows),))[column].shape == (len(rows),)


def read_run_file(path: Path) -> None:
    from validate.comparison.sides import Side
    from validate.results.report_again import _run_of
    from validate.runs.run_file import listed, needed, option

    assert Side("a", path.parent, {}).settings() is not None
    options = _run_of(path.parent)["options"]
    needed(path.parent, options, "store")
    option(path.parent, options, "trials")
    listed(path.parent, options, "set")
    listed(path.parent, options, "sweeps")


def read_fault(path: Path) -> None:
    """What a campaign has to notice, one after the other."""
    match sum(1 for _ in path.parent.glob("seen-*")):
        case 0:
            path.with_name("seen-0").touch()
            raise KeyError("of another kind")
        case 1:
            path.with_name("seen-1").touch()
            np.ones(2**40)
        case 2:
            path.with_name("seen-2").touch()
            while True:
                pass
        case _:
            from pss import PSSError

            raise PSSError("two\x1blines" + "x" * LONGEST_LINE)


KINDS: dict[str, tuple[Callable[[np.random.Generator, Path], Made], Callable[[Path], None]]] = {
    "scene": (a_scene, read_scene),
    "sweep": (a_sweep, read_sweep),
    "calibration": (a_calibration, read_calibration),
    "mesh": (a_mesh, read_mesh),
    "backdrop": (a_backdrop, read_xml),
    "view": (a_view, read_exr),
    "archive": (an_archive, read_archive),
    "table": (a_table, read_table),
    "run file": (a_run_file, read_run_file),
    "fault": (a_fault, read_fault),
}


# ---- the process that reads ------------------------------------------------------------------------------------------


def outcome_of(read: Callable[[Path], None], path: Path) -> str:
    """ "read", "refused", or what went wrong."""
    from pss import PSSError

    try:
        read(path)
    except PSSError as error:
        lines = str(error).split("\n")
        for line in lines:
            if not line or not line.isprintable() or len(line) > LONGEST_LINE:
                return f"a bad line of {len(line)} characters: {line[:200]!r}"
        return "refused"
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)[-3:]
        return f"{type(error).__name__}: {str(error)[:200]!r} in " + ", ".join(
            f"{Path(frame.filename).name}:{frame.lineno}" for frame in where
        )
    return "read"


def run(kind: str, seed: int, first: int, count: int, folder: Path, cpu_s: int) -> None:
    """Make and read the files of a campaign from the number `first` on."""
    make, read = KINDS[kind]
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else 0
    limit = pages * resource.getpagesize() + MOST_MEMORY
    for number in range(first, count):
        rng = np.random.default_rng([seed, number])
        name, content, change = make(rng, folder)
        print(json.dumps({"number": number, "said": change}), flush=True)
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
        used = resource.getrusage(resource.RUSAGE_SELF)
        spent = int(used.ru_utime + used.ru_stime)
        resource.setrlimit(resource.RLIMIT_CPU, (spent + cpu_s + 1, resource.RLIM_INFINITY))
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
        signal.alarm(LONGEST_WALL_S)
        outcome = outcome_of(read, path)
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        print(json.dumps({"number": number, "outcome": outcome}), flush=True)


# ---- the campaign ----------------------------------------------------------------------------------------------------


@dataclass
class Campaign:
    """How many files were read and refused, and a line for each that did neither."""

    read: int = 0
    refused: int = 0
    faults: list[str] = field(default_factory=list)


def campaign(kind: str, seed: int, count: int, folder: Path, cpu_s: int = LONGEST_CPU_S) -> Campaign:
    """Read `count` mutated files of a kind; where one ends the process, another goes on behind it."""
    done, first = Campaign(), 0
    while first < count:
        command = [
            sys.executable,
            "-m",
            "tests.helpers.fuzzing",
            kind,
            str(seed),
            str(first),
            str(count),
            str(folder),
            str(cpu_s),
        ]
        child = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment(), check=False)
        change, last = "nothing was made", first
        for line in map(json.loads, child.stdout.splitlines()):
            last, change = line["number"], line.get("said", change)
            outcome = line.get("outcome")
            if outcome in ("read", "refused"):
                setattr(done, outcome, getattr(done, outcome) + 1)
            elif outcome is not None:
                done.faults.append(f"{kind}, seed {seed}, file {last} ({change}): {outcome}")
        if child.returncode == 0:
            break
        end = child.stderr.strip().rpartition("\n")[2]
        done.faults.append(f"{kind}, seed {seed}, file {last} ({change}): ended by {child.returncode} {end}")
        first = last + 1
    return done


def prepare(folder: Path) -> None:
    """Put what mutated files name, and whole files to start from, into a folder."""
    shutil.copytree(ROOT / "scenes" / "workshop", folder / "workshop")
    for file in (ROOT / "scenes").glob("*.toml"):
        shutil.copy(file, folder / file.name)
    for file in (ROOT / "scenes" / "workshop").iterdir():
        shutil.copy(file, folder / file.name)
    (folder / "base").mkdir()


if __name__ == "__main__":
    run(sys.argv[1], *(int(number) for number in sys.argv[2:5]), Path(sys.argv[5]), int(sys.argv[6]))
