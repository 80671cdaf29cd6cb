"""Pictures of a run, read back pixel by pixel, and films, read back by Pillow and OpenCV."""

from __future__ import annotations

import dataclasses
import weakref
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from pss import PTZCamera, RangeError, ShapeError
from render.store.folder import StoreError
from render.world.state import Room
from validate.plots.film import FILM_ENDINGS, write_film
from validate.plots.film_frame import PICTURE_PX, FilmFrame, draw_frame
from validate.runs.palette import CATEGORIES

pytestmark = pytest.mark.slow

ROOM = Room(6.0, 10.0, 3.0, 0.6, 0.3, 0.75)
WIDTH, HEIGHT = 640, 480
# The file's order is not that of the plan: far right, near left, far left, near right.
PLACES = [(2.8, 4.8, 2.9), (-2.8, -4.8, 2.9), (-2.8, 4.8, 2.9), (2.8, -4.8, 2.9)]
CAMERAS = tuple(
    PTZCamera(place, 0, 0, zoom=2, focus_distance_m=4, resolution=(WIDTH, HEIGHT), name="abcd"[k]).aimed_at((0, 0, 0.9))
    for k, place in enumerate(PLACES)
)
# Where each view's middle is in the picture, as shares of it: above or below, left or right of the other.
ABOVE, LEFT = (True, False, True, False), (False, True, True, False)
# Marks sit on whole pixels, and a view is made smaller by a factor that is none.
SAME_PLACE_PX = 1.0
# A line's half width, with the dots on it.
WIDE_PX = 4
# Grey levels, mean over a picture, that the formats lose: white becomes 251 in a WebM. One step of a film changes more.
LOST_LEVELS = 4.5


def a_frame(**changes) -> FilmFrame:
    """Black views, and two avatars on their way."""
    record = {
        "step": 4,
        "time_s": 1.25,
        "cameras": CAMERAS,
        "assignments": ("H2", "H1", "H2", "H1"),
        "images": (np.zeros((HEIGHT, WIDTH), dtype=np.uint8),) * 4,
        "detections_px": (np.zeros((0, 2)),) * 4,
        "avatars": {"H1": np.array([-0.6, -1.5, 0.9]), "H2": np.array([0.6, 1.5, 0.9])},
        "headings_deg": {"H1": 0.0, "H2": 180.0},
        "expected_m": {},
    }
    return FilmFrame(**(record | changes))


def drawn(walked_m=None, **changes) -> np.ndarray:
    return draw_frame(a_frame(**changes), ROOM, "follow", walked_m)


def changed_at(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Picture pixels (x, y), the middle of what differs."""
    apart = np.abs(one.astype(float) - other).sum(axis=2)
    rows, columns = np.indices(apart.shape)
    assert apart.sum() > 0
    return np.array([(columns * apart).sum(), (rows * apart).sum()]) / apart.sum()


def with_image(index: int, image: np.ndarray) -> dict:
    """The change of a frame that has this image in one view."""
    return {"images": tuple(image if k == index else a_frame().images[k] for k in range(4))}


@pytest.fixture(scope="module")
def plain():
    return drawn()


@pytest.fixture(scope="module")
def plan(plain):
    """From metres (x, y) to the picture's pixels: by where the marks of what is expected appear at three places."""
    marks = {at: changed_at(plain, drawn(expected_m={"H1": np.array([*at, 0.9])})) for at in ((0, 4), (2, 4), (2, -4))}
    right, up = (marks[2, 4] - marks[0, 4]) / 2, (marks[2, 4] - marks[2, -4]) / 8
    return lambda x, y: marks[0, 4] + x * right + (y - 4) * up


def test_a_picture_has_its_size(plain):
    assert plain.dtype == np.uint8
    assert plain.shape == (PICTURE_PX[1], PICTURE_PX[0], 3)


# ---- the views -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("index", range(4))
def test_views_lie_as_their_cameras_do(plain, index):
    x, y = changed_at(plain, drawn(**with_image(index, np.full((HEIGHT, WIDTH), 255, dtype=np.uint8))))
    assert (y < PICTURE_PX[1] / 2) == ABOVE[index]
    assert (x < PICTURE_PX[0] / 3) == LEFT[index]
    assert x < 0.65 * PICTURE_PX[0]


@pytest.mark.parametrize(("u", "v", "shrunk"), [(40, 36, 1), (600, 80, 2), (322, 410, 1)])
def test_detections_are_drawn_where_the_image_shows_what_was_detected(plain, u, v, shrunk):
    """A white square about a pixel, and the mark of a detection at that pixel, both in place of black."""
    image = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    image[v - 4 : v + 5, u - 4 : u + 5] = 255
    image = cv2.resize(image, (WIDTH // shrunk, HEIGHT // shrunk), interpolation=cv2.INTER_AREA)
    square = changed_at(plain, drawn(**with_image(1, image)))
    none = np.zeros((0, 2))
    marked = drawn(detections_px=(none, np.array([[u, v]], dtype=float), none, none))
    # The caption, above the view, counts the marker.
    top = round(square[1]) - 14
    np.testing.assert_allclose(changed_at(plain[top:], marked[top:]) + [0, top], square, atol=SAME_PLACE_PX)


def test_light_is_brightened_by_the_gamma_and_bytes_are_shown_as_they_are(plain):
    for image, grey in (
        (np.full((HEIGHT, WIDTH), 0.2), 255 * 0.2 ** (1 / 2.2)),
        (np.full((HEIGHT, WIDTH), 7.0, dtype=np.float32), 255),
        (np.full((HEIGHT, WIDTH), 51, dtype=np.uint8), 51),
    ):
        picture = drawn(**with_image(2, image))
        x, y = np.rint(changed_at(plain, picture)).astype(int)
        assert abs(int(picture[y, x, 0]) - grey) <= 1
        assert np.ptp(picture[y, x]) == 0


def test_light_is_averaged_before_it_is_brightened(plain):
    """Half of the pixels white is half the light."""
    image = np.indices((HEIGHT, WIDTH)).sum(axis=0) % 2 * 1.0
    picture = drawn(**with_image(2, image))
    x, y = np.rint(changed_at(plain, picture)).astype(int)
    assert picture[y - 20 : y + 20, x - 20 : x + 20].mean() == pytest.approx(255 * 0.5 ** (1 / 2.2), abs=3)


def test_a_view_is_framed_in_the_colour_of_whom_its_camera_follows():
    white = np.full((HEIGHT, WIDTH), 255, dtype=np.uint8)
    for name, colour in zip(("H1", "H2"), CATEGORIES, strict=False):
        one = drawn(assignments=(name,) * 4, **with_image(2, white))
        row = one[one.shape[0] // 4, :40].astype(float) / 255  # across the left frame of the upper left view
        assert np.abs(row - to_rgb(colour)).max(axis=1).min() < 0.02
        other = CATEGORIES[1 - CATEGORIES.index(colour)]
        assert np.abs(row - to_rgb(other)).max(axis=1).min() > 0.2


# ---- the plan --------------------------------------------------------------------------------------------------------


def test_the_plan_has_one_scale_and_y_upwards(plan):
    right, up = plan(1, 0) - plan(0, 0), plan(0, 1) - plan(0, 0)
    assert right[0] > 30
    assert up[1] == pytest.approx(-right[0], rel=0.01)
    assert right[1] == pytest.approx(0, abs=0.1)
    assert up[0] == pytest.approx(0, abs=0.1)


def test_avatars_are_where_they_are_and_point_where_they_head(plan):
    colours = {name: np.array(to_rgb(colour)) * 255 for name, colour in zip(("H1", "H2"), CATEGORIES, strict=False)}
    picture = drawn(
        avatars={"H1": np.array([-1.5, -3.0, 0.9]), "H2": np.array([1.2, 2.0, 0.9])},
        headings_deg={"H1": 90.0, "H2": 0.0},
    )

    def off(name, x, y):
        column, row = np.rint(plan(x, y)).astype(int)
        return np.abs(picture[row, column] - colours[name]).max()

    for name, x, y in (("H1", -1.5, -3.0), ("H2", 1.2, 2.0)):
        assert off(name, x, y) < 2
    for name, x, y in (("H1", -1.5 + 0.4, -3.0), ("H2", 1.2, 2.4)):
        assert off(name, x, y) < 2
    for name, x, y in (("H1", -1.5, -3.0 + 0.4), ("H1", -1.5, -3.4), ("H2", 1.2, 1.6)):
        assert off(name, x, y) > 20


def test_what_was_walked_is_a_line(plan, plain):
    walked = drawn({"H1": np.array([[-0.6, -4.0, 0.9], [-0.6, -1.5, 0.9]])})
    rows, columns = np.nonzero((walked != plain).any(axis=2))
    start, end = plan(-0.6, -4.0), plan(-0.6, -1.5)
    assert np.abs(columns - start[0]).max() < WIDE_PX
    assert rows.max() == pytest.approx(start[1], abs=WIDE_PX)
    # The rest is under the avatar's disc.
    assert rows.min() >= end[1]
    middle = np.rint(plan(-0.6, -2.75)).astype(int)
    line = walked[middle[1], middle[0] - 3 : middle[0] + 4].astype(float)
    assert np.abs(line - 255 * np.array(to_rgb(CATEGORIES[0]))).max(axis=1).min() < 60


def test_a_wedge_has_the_colour_of_whom_the_camera_follows(plan):
    """Straight below the line of sight, where nothing else is drawn: one camera, and the avatars far from it."""
    away = {"H1": np.array([-2.5, 4.0, 0.9]), "H2": np.array([2.5, 4.0, 0.9])}
    camera = PTZCamera((0, -4.8, 2.9), 0, 0, zoom=2, focus_distance_m=4).aimed_at((0, 0, 0.9))
    column, row = np.rint(plan(0, 0.5)).astype(int)
    outside = np.rint(plan(2.8, -2)).astype(int)
    for name, redder in (("H1", False), ("H2", True)):
        picture = draw_frame(
            a_frame(
                cameras=(camera,),
                assignments=(name,),
                images=(np.zeros((HEIGHT, WIDTH)),),
                detections_px=(np.zeros((0, 2)),),
                avatars=away,
            ),
            ROOM,
            "follow",
        ).astype(int)
        assert (picture[row, column, 0] > picture[row, column, 2] + 10) == redder
        assert (picture[row, column, 2] > picture[row, column, 0] + 10) != redder
        assert np.ptp(picture[outside[1], outside[0]]) == 0


# ---- films -----------------------------------------------------------------------------------------------------------


def walk(count: int = 3) -> list[FilmFrame]:
    return [
        a_frame(
            step=k,
            time_s=k / 3,
            avatars={"H1": np.array([-0.6, -3 + 2.0 * k, 0.9]), "H2": np.array([0.6, 3 - 2.0 * k, 0.9])},
            images=(np.full((HEIGHT, WIDTH), 40 * (k + 1), dtype=np.uint8),) * 4,
        )
        for k in range(count)
    ]


def read_back(path: Path) -> tuple[list[np.ndarray], list[float]]:
    """The pictures of a film and how long each is held, in ms."""
    if path.suffix == ".webm":
        video, pictures = cv2.VideoCapture(str(path)), []
        while (read := video.read())[0]:
            pictures.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
        return pictures, [1000 / video.get(cv2.CAP_PROP_FPS)] * len(pictures)
    pictures, held = [], []
    with Image.open(path) as film:
        for k in range(getattr(film, "n_frames", 1)):
            film.seek(k)
            pictures.append(np.asarray(film.convert("RGB")))
            held.append(film.info.get("duration", 0))
        # A film of one picture has nothing to play over and over.
        assert len(pictures) == 1 or film.info["loop"] == 0
    return pictures, held


@pytest.fixture(scope="module")
def shown():
    """The pictures of `walk`, each with the way so far."""
    frames, pictures = walk(), []
    for k, frame in enumerate(frames):
        walked = {name: np.array([one.avatars[name] for one in frames[: k + 1]]) for name in ("H1", "H2")}
        pictures.append(draw_frame(frame, ROOM, "follow", walked).astype(float))
    return pictures


@pytest.mark.parametrize("ending", list(FILM_ENDINGS))
def test_a_film_has_its_frames_in_their_order(tmp_path, shown, ending):
    write_film(tmp_path / f"film{ending}", iter(walk()), ROOM, "follow", frames_per_second=4.0)
    pictures, held = read_back(tmp_path / f"film{ending}")
    assert len(pictures) == len(shown)
    assert held == pytest.approx([250] * 3, abs=11)
    apart = np.array([[np.abs(picture - one).mean() for one in shown] for picture in pictures])
    assert np.diagonal(apart).max() < LOST_LEVELS
    assert apart[~np.eye(3, dtype=bool)].min() > 4 * LOST_LEVELS
    assert [path.name for path in tmp_path.iterdir()] == [f"film{ending}"]


def test_each_picture_has_the_way_up_to_its_own_step(tmp_path, monkeypatch):
    ways = []
    monkeypatch.setattr(
        "validate.plots.film.draw_frame",
        lambda frame, room, strategy, walked: ways.append(walked) or np.full((720, 1280, 3), 50 * len(ways), np.uint8),
    )
    write_film(tmp_path / "film.webp", walk(), ROOM, "follow")
    for k, way in enumerate(ways):
        np.testing.assert_array_equal(way["H1"], [[-0.6, -3 + 2.0 * j, 0.9] for j in range(k + 1)])
    assert len(ways) == 3


@pytest.mark.parametrize("ending", list(FILM_ENDINGS))
def test_the_marks_of_what_was_found_keep_their_colour(tmp_path, ending):
    """They are few pixels among many greys, which a palette may leave without a colour of their own."""
    # Shaded and a little noisy, as walls are: on plain noise or plain shades any palette would do.
    shade = np.linspace(0.2, 0.7, WIDTH)
    noise = (np.random.default_rng(k).standard_normal((HEIGHT, WIDTH)) for k in range(4))
    views = tuple(np.clip(shade + 0.05 * each, 0, 1) for each in noise)
    found = (np.random.default_rng(4).uniform(50, 400, (12, 2)),) * 4
    write_film(tmp_path / f"film{ending}", [a_frame(images=views, detections_px=found)], ROOM, "follow")
    picture = read_back(tmp_path / f"film{ending}")[0][0].astype(int)[:, :860]
    green = (picture[..., 1] > picture[..., 0] + 60) & (picture[..., 1] > picture[..., 2] + 60)
    drawn_green = drawn(images=views, detections_px=found)[:, :860].astype(int)
    as_drawn = (drawn_green[..., 1] > drawn_green[..., 0] + 60) & (drawn_green[..., 1] > drawn_green[..., 2] + 60)
    assert green.sum() > 0.5 * as_drawn.sum() > 200


def test_frames_are_let_go_once_they_are_drawn(tmp_path):
    """No more than one that is being drawn and the one that is being made."""
    given: list[weakref.ref] = []

    def made():
        for k in range(3):
            frame = walk(k + 1)[-1]
            given.append(weakref.ref(frame))
            yield frame
            del frame
            assert sum(one() is not None for one in given) <= 1

    write_film(tmp_path / "film.webp", made(), ROOM, "follow")
    assert len(given) == 3


def test_what_cannot_be_a_film_is_refused_and_leaves_nothing(tmp_path):
    for name, frames, rate, says in (
        ("film.webp", [], 3.0, "frames is empty; allowed: at least one"),
        ("film.avi", walk(1), 3.0, r"film.avi ends in '.avi'; allowed: .webp, .gif, .webm"),
        ("film", walk(1), 3.0, r"ends in ''"),
        ("film.webp", walk(1), 0.0, "frames_per_second = 0.0"),
        ("film.gif", walk(1), 101.0, "frames_per_second = 101.0 for .gif; allowed: up to 100"),
    ):
        with pytest.raises(RangeError, match=says):
            write_film(tmp_path / name, frames, ROOM, "follow", rate)

    def broken():
        yield a_frame()
        raise KeyError("no more")

    with pytest.raises(KeyError, match="no more"):
        write_film(tmp_path / "film.webp", broken(), ROOM, "follow")
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StoreError, match="allowed is a folder"):
        write_film(tmp_path / "file" / "film.webp", walk(1), ROOM, "follow")


@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"assignments": ("H1",)}, ShapeError, "assignments has 1; allowed: 4"),
        ({"images": ()}, ShapeError, "images has 0"),
        ({"images": (np.zeros((4, 4, 3)),) * 4}, ShapeError, r"\(4, 4, 3\); allowed is \(H, W\)"),
        ({"images": (np.zeros((4, 4), dtype=np.uint16),) * 4}, RangeError, "uint16"),
        ({"detections_px": (np.zeros(2),) * 4}, ShapeError, r"\(2,\); allowed is \(M, 2\)"),
        ({"expected_m": {"H1": np.zeros(2)}}, ShapeError, r"\(2,\); allowed is \(3,\)"),
        ({"expected_m": {"H3": np.zeros(3)}}, RangeError, "no avatar 'H3'; allowed: H1, H2"),
        ({"assignments": ("H1", "H3", "H1", "H1")}, RangeError, "no avatar 'H3'"),
        ({"headings_deg": {"H1": 0.0}}, RangeError, r"lacks \['H2'\]"),
    ],
)
def test_frames_that_do_not_fit_are_refused(changes, error, says):
    with pytest.raises(error, match=says):
        a_frame(**changes)


@pytest.mark.parametrize(("count", "share"), [(1, 0.5), (5, 0.25)])
def test_a_frame_may_be_of_any_number_of_cameras(count, share):
    """Each view has a grey of its own, none lies over another or over the plan, and they fill their place fairly."""
    cameras = tuple(dataclasses.replace(CAMERAS[0], position_m=(0, k - 2, 2.9)) for k in range(count))
    levels = [20 + 30 * k for k in range(count)]
    picture = drawn(
        cameras=cameras,
        assignments=("H1",) * count,
        detections_px=(np.zeros((0, 2)),) * count,
        images=tuple(np.full((HEIGHT, WIDTH), level, dtype=np.uint8) for level in levels),
    )
    areas = [np.nonzero((picture[:, :860] == level).all(axis=2)) for level in levels]
    # Of text, whose edges have all greys, there is little.
    assert min(len(rows) for rows, _ in areas) > 0.9 * max(len(rows) for rows, _ in areas)
    assert sum(len(rows) for rows, _ in areas) > share * 828 * 668
