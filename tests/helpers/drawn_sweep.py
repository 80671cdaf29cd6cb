"""A sweep whose views are drawn in a moment instead of rendered: all else of a run is the real one.

    python -m tests.helpers.drawn_sweep

imports what a run needs once, and forks a process for each run that it is asked for (`Runs`): a run then takes half a
second in place of five.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera
from render.certificate import Certificate
from render.files.exr import write_view
from render.random_streams import random_stream
from render.renderer import RenderedView, ViewRequest
from render.world.marker_print import pattern
from render.world.state import Marker, SceneState
from tests.helpers.processes import environment
from tests.helpers.stored_views import QueueOfThisProcess

ROOT = Path(__file__).parents[2]
# A run may be killed at each of these: Python's own names of what is done to files, and half of a content written.
HALF_WRITTEN = "half written"
STEPS = ("open", "os.mkdir", "os.chmod", "os.rename", "os.remove", HALF_WRITTEN)
# W/(m² sr), of paper, ink and all else: as bright as the closet's lamp makes them, nearly.
WHITE, BLACK, GREY = 0.2, 0.01, 0.1
# Pixels of the drawing a module: its edges are blurred over a few pixels by warping, which does no harm here.
FINE = 8
CERTIFICATE = Certificate(0.1, 0.1, 0.2, 0.1, 0.4, 1000, 0.0)


def drawn(request: ViewRequest) -> RenderedView:
    """A view with its markers as flat prints where the camera has them, in front of grey, and nothing else in it."""
    camera, state = request.camera, request.state
    width, height = camera.resolution
    radiance = np.full((height, width), GREY, dtype=np.float32)
    marker_id = np.full((height, width), -1, dtype=np.int32)
    for marker in state.markers:
        corners = _corners_px(marker, state, camera)
        if corners is None:
            continue
        bits = np.pad(pattern(state.print.dictionary, marker.id), 1, constant_values=True)
        fine = np.kron(np.where(bits, WHITE, BLACK), np.ones((FINE, FINE))).astype(np.float32)
        side = len(fine)
        square = np.array([[0, 0], [side, 0], [side, side], [0, side]], dtype=np.float32) - 0.5
        onto = cv2.getPerspectiveTransform(square, corners.astype(np.float32))
        inside = cv2.warpPerspective(np.ones_like(fine), onto, (width, height)) > 0.5
        radiance[inside] = cv2.warpPerspective(fine, onto, (width, height), borderMode=cv2.BORDER_REPLICATE)[inside]
        marker_id[inside] = marker.id
    depth = np.full((height, width), 2.0, dtype=np.float32)
    normal = np.broadcast_to(np.array([0, 0, 1], dtype=np.float32), (height, width, 3)).copy()
    noise = random_stream(0, request.key, "drawn").integers(0, 1000, (height, width)).astype(np.uint16)
    return RenderedView(request.key, camera, request.sensor, radiance, depth, normal, marker_id, noise, CERTIFICATE)


def _corners_px(marker: Marker, state: SceneState, camera: PTZCamera) -> NDArray[np.float64] | None:
    """The print's corners from its top left on, (4, 2); None where one is behind the camera."""
    modules = len(pattern(state.print.dictionary, marker.id)) + 2
    half = marker.module_m * modules / 2
    right, up = marker.right, np.array(marker.up)
    corners = np.array(marker.centre_m) + half * np.array([up - right, up + right, right - up, -up - right])
    if (camera.to_camera_frame(corners)[:, 2] <= 0.1).any() or camera.rotation[2] @ np.array(marker.normal) > 0:
        return None
    return np.asarray(camera.project(corners)[0])


class DrawingRenderer:
    """In place of `render.renderer.Renderer`."""

    seconds: ClassVar[float] = 0.0

    def __init__(self, state: object, meshes: object, chosen: object) -> None:
        pass

    def render(self, request: ViewRequest) -> RenderedView:
        """The same request gives the same view."""
        time.sleep(self.seconds)
        return drawn(request)


def write_in_halves(patch: Any) -> None:
    """Have files written in two parts, as disks do, with a step between them."""
    from render.store import checksums, views

    def write_bytes(path: Path, data: bytes) -> int:
        half = len(data) // 2
        with path.open("wb", buffering=0) as file:
            file.write(data[:half])
            sys.audit(HALF_WRITTEN, str(path))
            file.write(data[half:])
        return len(data)

    def write_image(path: Path, view: RenderedView, request: ViewRequest) -> None:
        write_view(path, view, request)
        write_bytes(path, path.read_bytes())

    def write_line(handle: int, data: bytes) -> int:
        begins = data[:1] in (b"{", b"\n")
        written = os.write(handle, data[: len(data) // 2] if begins else data)
        if begins:
            sys.audit(HALF_WRITTEN, os.readlink(f"/proc/self/fd/{handle}"))
        return written

    patch(Path, "write_bytes", write_bytes)
    patch(Path, "write_text", lambda path, text, encoding=None: write_bytes(path, text.encode(encoding or "utf-8")))
    patch(views, "write_view", write_image)
    patch(checksums, "os", SimpleNamespace(**vars(os) | {"write": write_line}))


def stand_in(patch: Any, workers: bool) -> None:
    """Have views drawn, by `patch(object, name, value)`; without `workers`, measured here and not shown in figures."""
    import render.store.light as lighting
    import validate.acquire.acquire as acquiring
    from validate.plots import sweep as figures

    solve = lighting.solve_light
    patch(acquiring, "Renderer", DrawingRenderer)
    patch(lighting, "solve_light", lambda state, mi=None: solve(state))
    patch(lighting.backend, "start", lambda chosen: None)
    if not workers:
        patch(acquiring, "WorkerQueue", QueueOfThisProcess)
        patch(figures, "draw_all", lambda *arguments: None)
        patch(figures, "all_drawn", lambda *arguments: True)


class Runs:
    """A context in which runs are started, one after the other, each in a process group of its own."""

    def __enter__(self) -> Runs:
        self._server = subprocess.Popen(
            [sys.executable, "-m", "tests.helpers.drawn_sweep"],
            cwd=ROOT,
            env=environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._server.stdout is not None
        assert self._server.stdout.readline() == "ready\n"
        return self

    def __exit__(self, *error: object) -> None:
        assert self._server.stdin is not None
        self._server.stdin.close()
        self._server.wait()

    def run(
        self,
        folder: Path,
        out: str = "out",
        *,
        workers: bool = False,
        killed_at: int | str = 0,
        sweep: str = "alone.toml",
        drawing_s: float = 0.0,
        during: Callable[[int], None] = lambda pid: None,
    ) -> tuple[int, str]:
        """Run the sweep of `folder` with `store` and `out` in it, and give its exit code and what it printed.

        Args:
            workers: whether views are measured in worker processes, and figures drawn.
            killed_at: when the process group is killed: at so many steps with files, of those in `STEPS`, or when a
                file is half written whose name ends so; 0 for never.
            sweep: the file's name.
            drawing_s: s, that drawing a view takes longer.
            during: called with the process's id once it runs.
        """
        asked = [str(folder), out, workers, killed_at, sweep, drawing_s]
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(json.dumps(asked) + "\n")
        self._server.stdin.flush()
        during(int(self._server.stdout.readline()))
        code = int(self._server.stdout.readline())
        return code, (folder / f"{out}.log").read_text(encoding="utf-8", errors="replace")


def _count_steps(killed_at: int | str, within: str) -> list[int]:
    """Count what is done to files under a folder, and kill this process group there."""
    count = [0]

    def hear(event: str, arguments: tuple[Any, ...]) -> None:
        if event not in STEPS or not str(arguments[0]).startswith(within):
            return
        if event == "open" and not arguments[2] & (os.O_WRONLY | os.O_RDWR):
            return
        count[0] += 1
        half = event == HALF_WRITTEN and isinstance(killed_at, str) and str(arguments[0]).endswith(killed_at)
        if half or count[0] == killed_at:
            os.killpg(0, signal.SIGKILL)

    sys.addaudithook(hear)
    return count


def main(folder: Path, out: str, killed_at: int | str, sweep: str) -> int:
    """Run the command with the stand-ins, and leave the number of its steps in the folder's file `steps`."""
    from validate.run_sweep import main as run

    steps = _count_steps(killed_at, str(folder))
    code = run([str(folder / sweep), "--store", str(folder / "store"), "--out", str(folder / out)])
    (folder / "steps").write_text(str(steps[0]))
    return code


def serve() -> None:
    """Fork for each line of the standard input; answer with the process's id, and then with its exit code."""
    importlib.import_module("validate.commands.run_and_save")  # what every run needs

    answer = os.dup(1)
    os.write(answer, b"ready\n")
    for line in sys.stdin:
        folder, out, workers, killed_at, sweep, DrawingRenderer.seconds = json.loads(line)
        pid = os.fork()
        if not pid:
            code = 1
            try:
                os.setpgid(0, 0)
                log = os.open(Path(folder) / f"{out}.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
                os.dup2(log, 1)
                os.dup2(log, 2)
                stand_in(setattr, workers)
                write_in_halves(setattr)
                code = main(Path(folder), out, killed_at, sweep)
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(code)
        with contextlib.suppress(OSError):  # as the child does, whoever is first
            os.setpgid(pid, pid)
        os.write(answer, f"{pid}\n".encode())
        os.write(answer, f"{os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])}\n".encode())


if __name__ == "__main__":
    serve()
