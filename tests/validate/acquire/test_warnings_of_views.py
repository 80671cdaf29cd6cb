"""What a run warns of after its views: how many, the worst, and what helps, in one line each."""

from __future__ import annotations

import pytest

from pss import ImageSensor, PTZCamera
from render.certificate import Certificate
from render.lens.sampling import Sampling
from render.renderer import ViewRequest
from tests.helpers.keyed_state import STATE
from validate.acquire.acquire import Acquired, Acquisition
from validate.acquire.quality_warnings import SATURATED_SHARE, warn_of_render_noise, warn_of_saturation
from validate.acquire.view_names import view_names


def reported(warn, **values: list[float]) -> str:
    """What `warn` says of views of cameras "0", "1", … with these values in their certificates."""
    (field, numbers), acquired, requested = next(iter(values.items())), Acquired(), []
    for name, number in enumerate(numbers):
        camera = PTZCamera((name, 0, 1), 0, 0, name=str(name))
        request = ViewRequest(STATE, camera, ImageSensor(), Sampling(noise_ratio=0.6), "renderer")
        calm = {"edge_rms": 0.1, "edge_median": 0.1, "edge_p999": 0.1, "image_rms": 0.1, "image_p999": 0.1}
        acquired.certificates[request.key] = Certificate(
            **calm | {"samples": 1, "saturated_share": 0.0} | {field: number}
        )
        requested += [Acquisition(request, 1, 2)] * 2  # a view that two configurations share
    lines: list[str] = []
    warn(requested, acquired, lines.append, view_names(requested))
    return "\n".join(lines)


def test_saturated_views_are_counted_and_the_worst_is_named():
    output = reported(warn_of_saturation, saturated_share=[0.0, 0.002, 0.123, 0.0009])
    assert output == (
        "2 of 4 views have more than 0.1% of the pixels on markers saturated; the worst is the view of camera 2 "
        "(pan 0°, tilt 0°, zoom 1, focus 4 m): 12.3%. "
        'What helps: a shorter sensor.exposure_ms, a larger f_number, or exposure_ms = "auto"'
    )


@pytest.mark.parametrize("shares", [[0.0, 0.0], [SATURATED_SHARE, 0.0], [float("nan")]])
def test_without_saturation_nothing_is_said(shares):
    assert reported(warn_of_saturation, saturated_share=shares) == ""


def test_noisy_views_are_counted_and_the_worst_is_named():
    output = reported(warn_of_render_noise, edge_p999=[0.5, 0.61, 1.36, float("nan")])
    assert output.startswith("2 of 4 views have more sampling noise ")
    assert "1.36 of the sensor's noise, requested: 0.6 " in output
    assert "the worst is the view of camera 2 (pan 0°, tilt 0°, zoom 1, focus 4 m): 1.36" in output
    assert "\n" not in output
    assert reported(warn_of_render_noise, edge_p999=[0.6, 0.1]) == ""
