"""The main job, first from nothing and then again: `python benchmarks/sweep.py`.

Seconds of both runs and their ratio, seconds by stage, samples traced, bytes stored, and the peak memory of the largest
process and of all together.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import tempfile
import threading
import time
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


def timed(folder: Path, out: str) -> tuple[float, int, int]:
    """Run the three sweeps; seconds, and the peaks of the largest process and of all."""
    arguments = ["zoom", "focus", "selection", "--store", str(folder / "store"), "--out", str(folder / out)]
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, str(ROOT / "validate" / "run_sweep.py"), *arguments], cwd=ROOT, stdout=subprocess.DEVNULL
    )
    largest = together = 0
    done = threading.Event()

    def watch() -> None:
        nonlocal largest, together
        while not done.wait(0.25):
            one, everything = resident_bytes(process.pid)
            largest, together = max(largest, one), max(together, everything)

    watcher = threading.Thread(target=watch)
    watcher.start()
    process.wait()
    done.set()
    watcher.join()
    return time.perf_counter() - begin, largest, together


def main() -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first, largest, together = timed(folder, "first")
        again, *_ = timed(folder, "again")
        with (folder / "first" / "views.csv").open(encoding="utf-8") as file:
            samples = sum(int(row["samples"]) for row in csv.DictReader(file))
        stored = sum(path.stat().st_size for path in (folder / "store").rglob("*") if path.is_file())
        record = json.loads((folder / "first" / "run.json").read_text())
    print(f"first run {first:.0f} s, repeated {again:.1f} s, ratio {first / again:.1f}")
    print("stages: " + ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in record["seconds"].items()))
    print(f"{record['rendered']} views, {samples / 1e9:.2f} G samples, {stored / 1e6:.0f} MB stored")
    print(f"peak memory {largest / 1e9:.2f} GB in the largest process, {together / 1e9:.2f} GB in all")


if __name__ == "__main__":
    main()
