"""Markers found by the search beside OpenCV's stock parameters: `python benchmarks/marker_search.py`.

The same captures for each: rendered views of every scene, and drawn markers of every size, turn, tilt and light, also
at the image's edge. "Stock" is `cv2.aruco.DetectorParameters()` as it is, on the linear 8-bit image whose 99.9th
percentile is white; "12 bits >> 4" the same on the plain upper eight bits. A marker is wrong where its own is not: by
the rendered numbers, or as drawn.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import scenes
from benchmarks import drawn_markers
from benchmarks.drawn_markers import Drawing, edge_pictures, pictures
from pss import ImageSensor
from render import backend
from render.lens.sampling import Sampling
from render.renderer import RenderedView, Renderer
from render.sensor import capture
from render.store.folder import Store
from render.store.light import baked
from render.store.views import certificate_of, load_view, save_view
from render.world.marker_print import predefined_dictionary
from scenes import Scene
from validate.markers.detect import find_markers

ROOT = Path(__file__).resolve().parents[1]
# A bright laboratory of a machine-vision camera's resolution.
LAB = (
    "sensor.resolution_px=[1920, 1080]",
    "sensor.pixel_pitch_um=2.9",
    "lens.f_number=2.8",
    "light.radiance_w_per_m2_sr=1.2",
)
ZOOMS = (0.5, 1.0)
MOST_CAMERAS = 5
TRIALS = 2
WHITES_E = (100, 300, 1000, 3000, 10000)
SENSOR = ImageSensor(550.0, 0.5, 4.0, 10000.0, 6.0, 12, 64)
SIDES_PX = (12, 16, 20, 24, 32, 48, 80, 160, 320, 600)
BLURS_PX = (0.0, 0.7)
POSES_DEG = tuple(itertools.product((0, 7.5, 15, 22.5, 30, 37.5, 45), (0, 20, 40, 55, 65, 70)))
# A picture holds few large markers.
LARGE_PX, LARGE_POSES_DEG = 200, tuple(itertools.product((0, 20, 45), (0, 40, 70)))
EDGE_SIDES_PX, EDGE_GAPS_PX, EDGE_WHITES_E = (36, 80, 160), tuple(range(21)), (100, 1000, 9000)
# px from the marker's centre, or of its side, that a found one's may be.
NEAR_PX, NEAR_SHARE = 3, 0.1

Found = tuple[list[int], NDArray[np.floating]]


@dataclass
class Tally:
    """What one search found in the captures of a row."""

    right: int = 0
    wrong: int = 0
    seconds: list[float] = field(default_factory=list)


def search(capture_dn: NDArray[np.uint16], dictionary: str, black_dn: int) -> Found:
    """The project's own."""
    found = find_markers(capture_dn, dictionary)
    return found.ids.tolist(), found.corners_px


def _opencv(eight_bit: NDArray[np.uint8], dictionary: str) -> Found:
    detector = cv2.aruco.ArucoDetector(predefined_dictionary(dictionary), cv2.aruco.DetectorParameters())
    quads, ids, _ = detector.detectMarkers(eight_bit)
    return [] if ids is None else np.ravel(ids).tolist(), np.array(quads, dtype=float).reshape(-1, 4, 2)


def stock(capture_dn: NDArray[np.uint16], dictionary: str, black_dn: int) -> Found:
    """OpenCV's own parameters on the linear image."""
    lit = np.maximum(capture_dn.astype(np.float32) - black_dn, 0)
    white = max(np.percentile(lit[::4, ::4], 99.9), 1.0)
    return _opencv(cv2.convertScaleAbs(lit, alpha=255 / white), dictionary)


def upper_bits(capture_dn: NDArray[np.uint16], dictionary: str, black_dn: int) -> Found:
    """OpenCV's own parameters on the upper eight of twelve bits."""
    return _opencv((capture_dn >> 4).astype(np.uint8), dictionary)


SEARCHES: dict[str, Callable[[NDArray[np.uint16], str, int], Found]] = {
    "search": search,
    "stock": stock,
    "12 bits >> 4": upper_bits,
}


class Row:
    """A line of the table, filled capture by capture; the searches take turns, so that their times compare."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.tallies = {name: Tally() for name in SEARCHES}

    def add(
        self,
        capture_dn: NDArray[np.uint16],
        dictionary: str,
        black_dn: int,
        is_right: Callable[[int, NDArray[np.floating]], bool],
    ) -> None:
        """Search a capture by every method."""
        for name, find in SEARCHES.items():
            begin = time.thread_time()
            ids, corners = find(capture_dn, dictionary, black_dn)
            tally = self.tallies[name]
            tally.seconds.append(time.thread_time() - begin)
            right = {marker for marker, quad in zip(ids, corners, strict=True) if is_right(marker, quad)}
            tally.right += len(right)
            tally.wrong += sum(not is_right(marker, quad) for marker, quad in zip(ids, corners, strict=True))

    def print(self) -> None:
        """As a row of Markdown."""
        own, stock, upper = (self.tallies[name] for name in SEARCHES)
        ms = [1000 * float(np.median(tally.seconds)) for tally in (own, stock)]
        print(
            f"| {self.name} | {len(own.seconds)} | {own.right} | {stock.right} | {upper.right} "
            f"| {own.wrong}, {stock.wrong} | {ms[0]:.0f} ms | {ms[0] / ms[1]:.2f} |",
            flush=True,
        )


def _rendered(row: Row, view: RenderedView, dictionary: str) -> None:
    electrons = view.expected_electrons()

    def is_right(marker: int, quad: NDArray[np.floating]) -> bool:
        x, y = np.rint(quad.mean(axis=0)).astype(int)
        near = view.marker_id[max(y - NEAR_PX, 0) : y + NEAR_PX + 1, max(x - NEAR_PX, 0) : x + NEAR_PX + 1]
        return bool((near == marker).any())

    for trial in range(TRIALS):
        numbers = capture(electrons, view.sensor, np.random.default_rng(trial))
        row.add(numbers, dictionary, view.sensor.black_level_dn, is_right)


def _drawn(row: Row, drawing: Drawing, white_e: float, rng: np.random.Generator) -> None:
    def is_right(marker: int, quad: NDArray[np.floating]) -> bool:
        place = np.flatnonzero(drawing.ids == marker)
        if not len(place):
            return False
        own = drawing.corners_px[place[0]]
        away = np.linalg.norm(quad.mean(axis=0) - own.mean(axis=0))
        return bool(away <= max(NEAR_PX, NEAR_SHARE * np.linalg.norm(own[1] - own[0])))

    numbers = capture((drawing.light * np.float32(white_e)).astype(np.float32), SENSOR, rng)
    row.add(numbers, drawn_markers.DICTIONARY, SENSOR.black_level_dn, is_right)


def _views(scene: Scene, store: Store) -> Iterator[RenderedView]:
    """A few views of a scene, rendered where the store lacks them."""
    renderer = None
    chosen = backend.choose()
    for zoom, camera in itertools.product(ZOOMS, scene.cameras[:MOST_CAMERAS]):
        renderer = renderer or Renderer(scene.state, baked(scene.state, store, chosen), chosen)
        zoomed = dataclasses.replace(camera, zoom=max(1.0, camera.zoom * zoom))
        request = renderer.request(zoomed, scene.sensor, Sampling(noise_ratio=0.6))
        if certificate_of(store, request) is None:
            save_view(store, renderer.render(request), request)
        view = load_view(store, request.key)
        assert view is not None
        yield view


def scene_rows(store: Store, room_store: Store) -> Iterator[Row]:
    """A row for each scene; of the room, all views of a store of it."""
    room = scenes.load(ROOT / "scenes" / "room.toml")
    row = Row("room")
    for path in sorted(room_store.folder.glob("views/*/*.exr")):
        view = load_view(room_store, path.stem)
        if view is not None:
            _rendered(row, view, room.state.print.dictionary)
    yield row
    for name in ("atrium", "hallway", "workshop"):
        scene = scenes.load(ROOT / "scenes" / f"{name}.toml")
        row = Row(name)
        for view in _views(scene, store):
            _rendered(row, view, scene.state.print.dictionary)
        yield row
    lab = scenes.load(ROOT / "docs" / "examples" / "lab.toml", LAB)
    row = Row("bright laboratory, 1920 × 1080, f/2.8")
    for view in _views(lab, store):
        _rendered(row, view, lab.state.print.dictionary)
    yield row


def drawn_rows() -> Iterator[Row]:
    """A row for each light of drawn markers, and one for each light at the image's edge."""
    rows = {white: Row(f"drawn, 12 to 600 px, white of {white:,} e⁻") for white in WHITES_E}
    rng = np.random.default_rng(3)
    for side, blur in itertools.product(SIDES_PX, BLURS_PX):
        poses = POSES_DEG if side < LARGE_PX else LARGE_POSES_DEG
        for drawing in pictures(side, poses, blur, rng):
            for white, row in rows.items():
                _drawn(row, drawing, white, rng)
    yield from rows.values()
    edges = {white: Row(f"0 to 20 px from the image's edge, {white:,} e⁻") for white in EDGE_WHITES_E}
    for side in EDGE_SIDES_PX:
        for drawing in edge_pictures(side, EDGE_GAPS_PX, rng):
            for white, row in edges.items():
                _drawn(row, drawing, white, rng)
    yield from edges.values()


def main() -> None:
    """Print the table; exit with 1 if a row has fewer markers than stock parameters find, or wrong ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--store", type=Path, default=Path("results/store"), help="of the room's views")
    parser.add_argument("--own-store", type=Path, default=Path("results/marker-search"), help="of the other scenes'")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    print("| captures of | captures | found | stock | 12 bits >> 4 | wrong: search, stock | median time | of stock's |")
    print("|---|---|---|---|---|---|---|---|")
    rows = []
    for row in itertools.chain(drawn_rows(), scene_rows(Store(options.own_store), Store(options.store))):
        row.print()
        rows.append(row)
    short = [
        row.name
        for row in rows
        if row.tallies["search"].right < max(row.tallies[name].right for name in ("stock", "12 bits >> 4"))
    ]
    wrong, right = (sum(getattr(row.tallies["search"], kind) for row in rows) for kind in ("wrong", "right"))
    print(f"\n{right} found, {wrong} wrong; fewer than stock: {', '.join(short) or 'none'}")
    if short or wrong * 10_000 > right:
        sys.exit(1)


if __name__ == "__main__":
    main()
