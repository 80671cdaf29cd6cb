"""Warnings about acquired views: too much sampling noise, too much or too little light."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pss.cameras.views import Views
from pss.visibility.targets import LEAST_CONTRAST_OVER_NOISE
from render.keys import state_key
from validate.acquire.acquire import Acquired, Acquisition
from validate.markers.darkness import brightest_in_view, dark_words, white_irradiance

__all__ = ["SATURATED_SHARE", "warn_of_darkness", "warn_of_render_noise", "warn_of_saturation"]

# Of the pixels on a view's markers (0 to 1): one of a marker's few hundred may be saturated, and its centre does not
# notice.
SATURATED_SHARE = 0.001


def warn_of_render_noise(
    requested: Sequence[Acquisition], acquired: Acquired, warn: Callable[[str], None], names: Mapping[str, str]
) -> None:
    """Name the views with more sampling noise than requested, in one line; `names` by the views' hashes."""
    bounds = {item.request.key: item.request.sampling.noise_ratio for item in requested}
    missed = {
        key: certificate.edge_p999
        for key, certificate in acquired.certificates.items()
        if not certificate.meets(bounds[key])
    }
    if missed:
        worst = max(missed, key=lambda key: missed[key])
        warn(
            f"{len(missed)} of {len(bounds)} views have more sampling noise at the edges of markers than requested; "
            f"the worst is {names[worst]}: {missed[worst]:.2f} of the sensor's noise, requested: {bounds[worst]:g} "
            "(99.9th percentile)"
        )


def warn_of_darkness(
    requested: Sequence[Acquisition], acquired: Acquired, warn: Callable[[str], None], names: Mapping[str, str]
) -> None:
    """Name the views in which even the best lit marker is lost in the noise of a capture, and what helps."""
    requests = {item.request.key: item.request for item in requested}
    dark: dict[str, tuple[float, str]] = {}
    for key, request in requests.items():
        appearance = acquired.appearances.get(state_key(request.state))
        if appearance is None:
            continue
        views = Views([request.camera], request.state.points_m, request.state.normals, appearance)
        [(contrast, white_e, best)] = brightest_in_view(views, request.sensor)
        if best >= 0 and contrast < LEAST_CONTRAST_OVER_NOISE and white_e < request.sensor.saturation_e:
            light = float(white_irradiance(views, request.state)[0, best])
            dark[key] = contrast, dark_words(white_e, contrast, light, request.camera, request.sensor)
    if dark:
        worst = min(dark, key=lambda key: dark[key][0])
        warn(f"{len(dark)} of {len(requests)} views are too dark; the worst is {names[worst]}: {dark[worst][1]}")


def warn_of_saturation(
    requested: Sequence[Acquisition], acquired: Acquired, warn: Callable[[str], None], names: Mapping[str, str]
) -> None:
    """Name the views whose markers saturate, and a remedy: saturated edges appear displaced.

    Args:
        names: what people call the views, by their hashes.
    """
    count = len({item.request.key for item in requested})
    bright = {
        key: certificate.saturated_share
        for key, certificate in acquired.certificates.items()
        if certificate.saturated_share > SATURATED_SHARE
    }
    if bright:
        worst = max(bright, key=lambda key: bright[key])
        warn(
            f"{len(bright)} of {count} views have more than {SATURATED_SHARE:.1%} of the pixels on markers "
            f"saturated; the worst is {names[worst]}: {bright[worst]:.1%}. What helps: a shorter "
            'sensor.exposure_ms, a larger f_number, or exposure_ms = "auto"'
        )
