"""A run that is killed loses nothing: whatever is there is whole, and the next run goes on to the same tables.

The views are drawn instead of rendered (`tests.helpers.drawn_sweep`), so that much of a run's time is spent in writing;
that a real one goes on behind an interrupt is in `tests/validate/sweeps/test_sweep_run.py`.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time

import numpy as np
import pytest

from render.store.atomic import ABANDONED_S
from tests.helpers.closet import DETERMINED
from tests.helpers.whole_files import check_all_whole, tables, temporary_files, uninterrupted, with_sweep

pytestmark = pytest.mark.slow

# Of the campaign: at random moments, and at steps between two things done to files, where nothing else would be hit.
MOMENTS, STEPS = 30, 20
SEED = 2026


def killed(runs, folder, workers, after_s=None, at_step=0):
    """Run and kill; gives the number of temporary files that this left."""

    def kill(pid):
        time.sleep(after_s)
        with contextlib.suppress(ProcessLookupError):  # it was faster this time
            os.killpg(pid, signal.SIGKILL)

    during = (lambda pid: None) if after_s is None else kill
    code, output = runs.run(with_sweep(folder), workers=workers, killed_at=at_step, during=during)
    assert code == -signal.SIGKILL or (code == 0 and not at_step), output
    return len(temporary_files(folder))


def check_resumed(runs, folder, expected, workers):
    """The next run ends with the same tables, finds nothing damaged, and clears away what the killed one left."""
    old = time.time() - 2 * ABANDONED_S
    for path in temporary_files(folder):
        os.utime(path, (old, old))
    code, output = runs.run(folder, workers=workers)
    assert code == 0, output
    assert "set aside" not in output
    assert tables(folder / "out") == expected
    assert not temporary_files(folder)


def test_a_run_that_is_killed_again_and_again_goes_on_to_the_same_tables(runs, tmp_path):
    """With half a view written, half a checksum and half a table, one after the other."""
    expected, _, _ = uninterrupted(runs, tmp_path / "whole", workers=False)
    assert set(expected) == set(DETERMINED)
    left = 0
    for name in (".exr", ".exr.sum", ".csv"):
        left += killed(runs, tmp_path / "run", False, at_step=name)
        check_all_whole(tmp_path / "run", expected)
    assert left >= 3
    check_resumed(runs, tmp_path / "run", expected, False)


@pytest.mark.acceptance
def test_a_run_that_is_killed_at_fifty_moments_goes_on_to_the_same_tables(runs, tmp_path):
    """Thirty at random over its time, workers and figures included, and twenty in the middle of its writing."""
    expected, seconds, steps = uninterrupted(runs, tmp_path / "whole", workers=True)
    rng = np.random.default_rng(SEED)
    moments = [(after_s, 0) for after_s in rng.uniform(0, seconds, MOMENTS)]
    moments += [(None, int(step)) for step in np.linspace(1, steps - 1, STEPS)]
    left = began = 0
    for number, (after_s, step) in enumerate(moments):
        folder = tmp_path / f"{number}"
        left += killed(runs, folder, True, after_s, step) > 0
        began += (folder / "store").exists()
        check_all_whole(folder, expected)
        check_resumed(runs, folder, expected, True)
    print(
        f"{len(moments)} kills in a run of {seconds:.1f} s and {steps} steps with files: {began} after its store was "
        f"begun, {left} left temporary files; all {len(moments)} went on to the same tables"
    )
    assert left >= STEPS // 4
