"""The figures of docs/sensor.md, from captures: the photon transfer curve and the lens's fall-off."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pss import ImageSensor, PTZCamera
from render.sensor import capture, expected_electrons, fixed_pattern
from tests.helpers.photon_transfer import Laboratory

__all__ = ["draw_fall_off", "draw_photon_transfer"]

# Colour-blind safe (Okabe and Ito), as in the other figures.
BLUE, ORANGE, GREEN, BLACK, GREY = "#0072B2", "#D55E00", "#009E73", "#111111", "#777777"
DPI = 150
# Both laws are to hold within this share.
BAND = 0.02
# Shares of the saturation up to which the law holds: beyond, the full well takes noise away.
LAW_BELOW = 0.9
# Standard errors of the fixed pattern's variance from which a point of it is drawn.
CLEAR = 8.0


def draw_photon_transfer(path: Path, sensor: ImageSensor, seed: int) -> float:
    """Variance against mean from two electrons to beyond saturation; the largest deviation from the law below it."""
    laboratory = Laboratory(sensor, (640, 480), seed)
    gain, seconds = 1 / sensor.gain_e_per_dn, sensor.exposure_ms * 1e-3
    levels_e = np.concatenate(
        [np.geomspace(2, 0.85 * sensor.saturation_e, 36), sensor.saturation_e * np.linspace(0.9, 1.2, 13)]
    )
    signal, temporal, fixed = [], [], []
    dark_dn = np.mean([laboratory.frame(0.0, seconds).mean() for _ in range(4)])
    for level in levels_e / sensor.quantum_efficiency:
        a, b = (laboratory.frame(level, seconds).astype(float) for _ in range(2))
        signal.append((a.mean() + b.mean()) / 2 - dark_dn)
        temporal.append(np.var(a - b) / 2)
        # What two frames have in common is the camera's own.
        fixed.append(float(np.cov(a.ravel(), b.ravel())[0, 1]))
    mean, variance, common = (np.array(values) for values in (signal, temporal, fixed))
    floor = gain**2 * (sensor.read_noise_e**2 + sensor.dark_signal_e) + 1 / 12
    model = floor + gain * mean
    deviation = variance / model - 1
    holds = levels_e < LAW_BELOW * sensor.saturation_e

    figure, (main, below) = _panels()
    line = np.geomspace(0.4, 4300, 200)
    main.loglog(line, floor + gain * line, color=BLUE, lw=1.8, zorder=2)
    main.loglog(line, gain * line, color=BLUE, lw=1.1, ls=(0, (5, 3)), zorder=1)
    main.axhline(floor, color=GREY, lw=1.1, ls=(0, (5, 3)), zorder=1)
    uneven = (sensor.prnu_share * line) ** 2 + (gain * sensor.dsnu_e) ** 2
    main.loglog(line, uneven, color=ORANGE, lw=1.4, zorder=2)
    main.loglog(mean, variance, "o", color=BLACK, ms=4.5, zorder=4)
    # Only where the covariance of two frames stands clear of its own error.
    expected = (sensor.prnu_share * mean) ** 2 + (gain * sensor.dsnu_e) ** 2
    clear = (expected > CLEAR * variance / math.sqrt(640 * 480)) & holds
    main.loglog(mean[clear], common[clear], "D", color=ORANGE, ms=4, mfc="white", zorder=3)
    full = sensor.saturation_e * gain
    for axes in (main, below):
        axes.axvline(full, color=GREEN, lw=1.2)
    main.text(full * 0.93, 0.065, "full well", color=GREEN, rotation=90, ha="right", va="bottom")
    main.text(3300, floor * 1.08, "dark noise: $\\sigma_d^2 K^2 + 1/12$", color=GREY, va="bottom", ha="right")
    main.text(1.7, 0.55, f"shot noise: slope 1,\n$K$ = {gain:.3f} DN/e⁻", color=BLUE, va="top")
    main.text(150, 0.105, "fixed pattern: slope 2,\nPRNU " + f"{sensor.prnu_share:.1%}", color=ORANGE, va="bottom")
    main.text(3.2, 0.135, f"DSNU {sensor.dsnu_e:g} e⁻", color=ORANGE, va="center")
    main.text(30, 60, "temporal noise:\none pair of frames a point", color=BLACK, ha="center", va="bottom")
    main.set(xlim=(0.5, 7000), ylim=(0.05, 4000), ylabel="variance in DN²")
    main.set_title("Photon transfer: a 3.45 µm global-shutter sensor", loc="left", fontsize=12, fontweight="bold")

    below.axhspan(-100 * BAND, 100 * BAND, color=BLUE, alpha=0.12, lw=0)
    below.axhline(0, color=BLUE, lw=1.2)
    below.plot(mean, 100 * deviation, "o", color=BLACK, ms=4.5)
    below.set(xscale="log", ylim=(-3.2, 3.2), xlabel="mean above dark in DN", ylabel="off the law, %")
    below.text(0.55, 2.15, "± 2 %", color=BLUE, fontsize=9)
    gone = 100 * deviation < -3
    below.plot(mean[gone], np.full(gone.sum(), -2.85), "v", color=GREEN, ms=6)
    below.text(full * 0.9, -2.85, "saturated", color=GREEN, fontsize=9, ha="right", va="center")
    electrons = main.secondary_xaxis("top", functions=(lambda dn: dn / gain, lambda e: e * gain))
    electrons.set_xlabel("mean charge in e⁻")
    _save(figure, path)
    return float(np.abs(deviation[holds]).max())


def draw_fall_off(path: Path, sensor: ImageSensor, seed: int) -> float:
    """A white wall through the 90° lens: light by angle beside cos⁴ θ; the largest deviation of a ring."""
    camera = PTZCamera((seed, 0, 0), 0, 0, zoom=1, resolution=(1280, 960))
    one = expected_electrons(np.ones((960, 1280)), camera, sensor)
    electrons = one * (0.85 * sensor.saturation_e / one.max())
    pattern = fixed_pattern(camera, sensor)
    rng = np.random.default_rng(seed)
    frames = [capture(electrons, sensor, rng, pattern).astype(float) for _ in range(2)]
    signal = np.mean(frames, axis=0) - capture(np.zeros((960, 1280)), sensor, rng, pattern).mean()
    v, u = np.mgrid[:960, :1280]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.intrinsic_matrix).T
    angle_deg = np.degrees(np.arctan(np.hypot(rays[..., 0], rays[..., 1])))
    edges = np.arange(0, 51.1, 2)
    ring = np.digitize(angle_deg.ravel(), edges) - 1
    count = np.bincount(ring, minlength=len(edges))[: len(edges) - 1]
    rows = [
        np.bincount(ring, weights=x.ravel(), minlength=len(edges))[: len(edges) - 1] / count
        for x in (signal, np.cos(np.radians(angle_deg)) ** 4, angle_deg)
    ]
    light, law, centre = rows[0] / rows[0][0] * rows[1][0], rows[1], rows[2]

    figure, (main, below) = _panels()
    line = np.linspace(0, 52, 200)
    main.plot(line, np.cos(np.radians(line)) ** 4, color=BLUE, lw=1.8)
    main.plot(centre, light, "o", color=BLACK, ms=4.5)
    main.text(30, 0.66, r"$\cos^4\theta$", color=BLUE, fontsize=13)
    main.text(8, 0.25, "rings of equal angle in two captures\nof a white wall, 90° lens", color=BLACK)
    main.set(xlim=(0, 52), ylim=(0, 1.05), ylabel="light relative to the axis")
    main.set_title("Fall-off towards the corners", loc="left", fontsize=12, fontweight="bold")
    below.axhspan(-100 * BAND, 100 * BAND, color=BLUE, alpha=0.12, lw=0)
    below.axhline(0, color=BLUE, lw=1.2)
    below.plot(centre, 100 * (light / law - 1), "o", color=BLACK, ms=4.5)
    below.set(ylim=(-3.2, 3.2), xlabel="angle off the axis θ in degrees", ylabel="off the law, %")
    below.text(0.6, 2.15, "± 2 %", color=BLUE, fontsize=9)
    _save(figure, path)
    return float(np.abs(light / law - 1).max())


def _panels() -> tuple[Figure, tuple[Axes, Axes]]:
    plt.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    return plt.subplots(2, 1, figsize=(7.2, 6.2), sharex=True, height_ratios=[3.2, 1], layout="constrained")


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    plt.close(figure)
