"""docs/metric.md: its example prints what it says, its names exist, and what it says of the equations is so."""

import contextlib
import dataclasses
import importlib
import io
import math
import re
from pathlib import Path

import numpy as np
import pytest

import pss
from scenes import known_sweeps, load_sweep

PAGE = (Path(__file__).parents[2] / "docs" / "metric.md").read_text(encoding="utf-8")
# Relative; a few roundings.
SAME_TO_ROUNDING = 1e-9

CAMERAS = [
    pss.PTZCamera((x, -2.5, 1.5), 0, 0, zoom=2, focus_distance_m=2.5).aimed_at((0, 0, 1)) for x in (-1.5, 0.5, 1.5)
]
POINTS = np.random.default_rng(0).uniform((-0.4, -0.3, 0.7), (0.4, 0.3, 1.3), (30, 3))
NORMALS = np.tile([0.0, -1.0, 0.0], (30, 1))


def test_the_worked_example_prints_what_the_page_says():
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)
    output = re.search(r"```text\n(.*?)```", PAGE, re.DOTALL).group(1)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "docs/metric.md", "exec"), {})
    assert [line.rstrip() for line in printed.getvalue().splitlines()] == [
        line.rstrip() for line in output.splitlines()
    ]


def test_the_names_on_the_page_exist():
    modules = ("metric.aggregation", "riccati.solve", "surrogates")
    places = [pss, *(importlib.import_module(f"pss.{name}") for name in modules)]
    places += [pss.noise, pss.Evaluation, pss.PTZCamera, pss.Aggregation]
    called = set(re.findall(r"`([A-Za-z_]\w*(?:\.\w+)*)\(?[^`]*`", re.sub(r"```.*?```", "", PAGE, flags=re.DOTALL)))
    missing = []
    for name in called:
        found = any(all(hasattr(o, part) for o, part in _walk(place, name)) for place in places)
        fields = {f.name for f in dataclasses.fields(pss.Evaluation)} | {"method"}
        if not found and name.split(".")[-1] not in fields | IN_PASSING:
            missing.append(name)
    assert not missing, missing


# Method names, options and arguments, which are no attributes of anything.
IN_PASSING = {
    *(
        "eigenstructure",
        "doubling",
        "scipy",
        "axes",
        "auto",
        "physical",
        "identity",
        "calibrated",
        "corrected",
        "python",
    ),
    *("px2_per_m2", "covariance", "name", "linearised", "of_objects", "without", "weighted", "plus", "as"),
}


def _walk(place, name):
    """The objects and attributes on the way of a dotted name."""
    way, here = [], place
    for part in name.removeprefix("pss.").split("."):
        way.append((here, part))
        here = getattr(here, part, None)
    return way


def test_the_sensitivity_table_has_all_shipped_sweeps():
    """A sweep of cameras that is added changes what the command prints: the page's table is then an old one."""
    header = next(line for line in PAGE.splitlines() if line.startswith("| model | constant |"))
    assert re.findall(r"ρ ([\w-]+)", header) == [name for name in known_sweeps() if not load_sweep(name).varies_scene]


@pytest.mark.parametrize("model", ["as-printed", "corrected"])
def test_equation_12_cancels_resolution(model):
    """The same sensor area in twice as many pixels: H and √R grow alike, and nothing is resolved better."""
    alone = pss.noise_model(model).without("distance-incidence", "defocus")
    fine = [dataclasses.replace(c, resolution=(2560, 1920), pixel_pitch_m=c.pixel_pitch_m / 2) for c in CAMERAS]
    coarse, finer = (pss.evaluate(cs, POINTS, NORMALS, noise=alone) for cs in (CAMERAS, fine))
    np.testing.assert_allclose(finer.single_frame_sigma_m, coarse.single_frame_sigma_m, rtol=SAME_TO_ROUNDING)
    whole = (pss.evaluate(cs, POINTS, NORMALS, noise=model).pss for cs in (CAMERAS, fine))
    assert next(whole) < next(whole)


def test_equation_12_makes_square_pixels_anisotropic_and_lowers_noise_off_the_axis():
    alone = pss.noise_model("as-printed").without("distance-incidence", "defocus")
    R = alone.covariance(CAMERAS[0], POINTS, NORMALS)
    np.testing.assert_allclose(R[:, 0, 0] / R[:, 1, 1], (1280 / 960) ** 2, rtol=SAME_TO_ROUNDING)
    cosine = CAMERAS[0].cos_off_axis(POINTS)
    assert np.argmin(R[:, 0, 0]) == np.argmin(cosine)


def test_sigma_grows_with_c_but_not_in_proportion():
    """σ∞² = √(q·c) where q is small beside c."""
    result = pss.evaluate(CAMERAS, POINTS, NORMALS, process=pss.RandomWalk(1e-7))
    expected = np.sqrt(1e-7 * result.single_frame_sigma_m)
    np.testing.assert_allclose(result.sigma_m, expected, rtol=1e-4)
    assert math.isclose(result.pss, np.mean(1 / expected), rel_tol=1e-4)


def test_a_metric_gets_the_inputs_of_evaluate():
    for name in ("pss", "pss-single-frame", "visible-share"):
        metric = pss.METRICS[name]
        direct = metric(CAMERAS, POINTS, NORMALS, noise="corrected")
        assert direct == metric.score(pss.evaluate(CAMERAS, POINTS, NORMALS, noise="corrected"))
