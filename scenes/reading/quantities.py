"""Number types of a file; a description is the text after "allowed:" in messages."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from scenes.reading.limits import LONGEST_TITLE, MOST_TRIALS
from scenes.reading.spec import Number, Positive

__all__ = [
    "Albedo",
    "Degrees",
    "Direction",
    "FilePath",
    "MarkerId",
    "Metres",
    "Millimetres",
    "NoiseRatio",
    "Point",
    "SceneFile",
    "Seed",
    "Title",
    "Trials",
]

Metres = Annotated[Positive, Field(description="a number above 0, in metres")]
Millimetres = Annotated[Positive, Field(description="a number above 0, in millimetres")]
Degrees = Annotated[Number, Field(description="a number, in degrees")]
Albedo = Annotated[Number, Field(ge=0, le=1, description="a number from 0 to 1")]
Point = Annotated[tuple[Number, Number, Number], Field(description="[x, y, z], in metres")]
Direction = Annotated[tuple[Number, Number, Number], Field(description="[x, y, z], a direction of any length above 0")]
MarkerId = Annotated[int, Field(strict=True, ge=0, description="a whole number, 0 or more")]
# One trial has no spread: the σ of a point is estimated from two or more.
Trials = Annotated[
    int, Field(strict=True, ge=2, le=MOST_TRIALS, description=f"a whole number, 2 or more, at most {MOST_TRIALS}")
]
FilePath = Annotated[str, Field(strict=True, min_length=1, description="the path of a file, from this file")]
SceneFile = Annotated[str, Field(strict=True, min_length=1, description="the path of a scene file, from this file")]
Title = Annotated[
    str,
    Field(strict=True, min_length=1, max_length=LONGEST_TITLE, description=f"text, {LONGEST_TITLE} characters at most"),
]
Seed = Annotated[int, Field(strict=True, ge=0, description="a whole number, 0 or more")]
NoiseRatio = Annotated[
    Number, Field(gt=0, le=10, description="a number above 0, at most 10: of the sensor's noise (σ)")
]
