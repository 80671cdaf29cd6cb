"""The main job, first from nothing and then again: `python benchmarks/sweep.py`.

Seconds of both runs and their ratio, seconds by stage, samples traced, bytes stored, and the peak memory of the largest
process and of all together.
"""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]


def resident_bytes(root: int) -> tuple[int, int]:
    """Resident memory of a process and its descendants now: the largest one's, and the sum (Linux)."""
    parents, sizes = {}, {}
    for status in Path("/proc").glob("[0-9]*/status"):
        try:
            fields = dict(line.split(":", 1) for line in status.read_text().splitlines() if ":" in line)
        except OSError:
            continue
        parents[int(fields["Pid"])] = int(fields["PPid"])
        sizes[int(fields["Pid"])] = 1024 * int(fields.get("VmRSS", "0 kB").split()[0])
    family = {root}
    while grown := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= grown
    found = [sizes.get(pid, 0) for pid in family]
    return max(found), sum(found)


@dataclass(frozen=True)
class Timed:
    """A finished run: exit code, seconds, peak memory of the largest process and of all, and what it printed."""

    code: int
    seconds: float
    largest_bytes: int
    together_bytes: int
    printed: str


def timed(folder: Path, out: str) -> Timed:
    """Run the three sweeps with the store and the results under `folder`."""
    arguments = ["zoom", "focus", "selection", "--store", str(folder / "store"), "--out", str(folder / out)]
    script = [sys.executable, str(ROOT / "validate" / "run_sweep.py"), *arguments]
    begin = time.perf_counter()
    with (folder / f"{out}.log").open("w+", encoding="utf-8") as log:
        process = subprocess.Popen(script, cwd=ROOT, stdout=log, stderr=subprocess.STDOUT)
        largest = together = 0
        while process.poll() is None:
            one, everything = resident_bytes(process.pid)
            largest, together = max(largest, one), max(together, everything)
            time.sleep(0.25)
        seconds = time.perf_counter() - begin
        log.seek(0)
        return Timed(process.returncode, seconds, largest, together, log.read())


def repeated(folder: Path) -> Timed:
    """The run into `folder`/first once more, on a copy of what it left: `folder`/again."""
    shutil.copytree(folder / "first", folder / "again", symlinks=True)
    return timed(folder, "again")


def figures(folder: Path, first: Timed, again: Timed) -> str:
    """What two runs into `folder`/first and `folder`/again took, in lines."""
    with (folder / "first" / "views.csv").open(encoding="utf-8") as file:
        samples = sum(int(row["samples"]) for row in csv.DictReader(file))
    stored = sum(path.stat().st_size for path in (folder / "store").rglob("*") if path.is_file())
    record = json.loads((folder / "first" / "run.json").read_text())
    stages = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in record["seconds"].items())
    return (
        f"first run {first.seconds:.0f} s, repeated {again.seconds:.1f} s, ratio {first.seconds / again.seconds:.1f}\n"
        f"stages of the first run: {stages}\n"
        f"{record['rendered']} views, {samples / 1e9:.2f} G samples, {stored / 1e6:.0f} MB stored\n"
        f"peak memory {first.largest_bytes / 1e9:.2f} GB in the largest process, "
        f"{first.together_bytes / 1e9:.2f} GB in all"
    )


def main() -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(figures(folder, timed(folder, "first"), repeated(folder)))


if __name__ == "__main__":
    main()
