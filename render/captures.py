"""Noisy captures of a rendered view, each with its own random numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor, PTZCamera
from pss.hints import Images
from render.keys import content_of
from render.random_streams import random_stream
from render.sensor import capture, fixed_pattern

__all__ = ["Captured", "captures"]


class Captured(Protocol):
    """The attributes of a rendered view that a capture needs (`render.renderer.RenderedView`)."""

    @property
    def key(self) -> str:
        """The view's name."""

    @property
    def camera(self) -> PTZCamera:
        """The camera, whose pixels have their own pattern."""

    @property
    def sensor(self) -> ImageSensor:
        """The sensor."""

    def expected_electrons(self) -> Images:
        """Mean photoelectrons of every pixel, (height, width)."""


def captures(view: Captured, seed: int, trials: Iterable[int]) -> Iterator[NDArray[np.uint16]]:
    """Captures of a view in digital numbers, (height, width) each: one for each number in `trials`.

    The random numbers depend on the view's content, the seed and the trial number only, so that a trial is the same
    capture in every run.
    """
    electrons, pattern = view.expected_electrons(), fixed_pattern(view.camera, view.sensor)
    for trial in trials:
        rng = random_stream(seed, content_of(view.key), "capture", trial)
        yield capture(electrons, view.sensor, rng, pattern)
