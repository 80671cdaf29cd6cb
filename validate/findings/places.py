"""Evaluated rooms and lights, each with the tables of a bank, from results/reference or from one bank alone."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pss.hints import CsvRow
from validate.runs.csv_file import Tables, all_of, first_of, read_tables

__all__ = ["COUNT", "FILTER", "HEADLINE", "SHARE", "SINGLE_FRAME", "Place", "places_of_bank", "places_of_reference"]

# The camera count of the headline.
HEADLINE = "4"
SINGLE_FRAME, FILTER = "measured_pss_single_frame", "measured_pss_filter"
# The two counts that a prediction of errors must do better than: of the cameras that see a point, at most three, and of
# the points that two cameras see.
COUNT, SHARE = "visibility-count", "visible-share"
_OF_MEASURE = {SINGLE_FRAME: "pss-single-frame", FILTER: "pss"}
# What a scene's tables end in, behind the scene's name and a hyphen.
_NAMES = ("leaderboard", "ceiling", "consistency", "detection", "parts", "sensitivity", "blunders", "process")
_NAMES += ("reliability", "size", "differences", "scale")
# Folder, title, population and renders of a view of each bank; a folder of another name is shown under its own.
_BANKS = {
    "bank": ("room", "the room's seven", 2),
    "bank-third": ("studio", "the studio's seven", 2),
    "bank-dim": ("room at ¼ light", "the room's seven", 1),
    "bank-bright": ("room at 4 × light", "the room's seven", 1),
    "bank-half-full-well": ("room at 30 × light", "the room's seven", 2),
}
_OTHER_LIGHTS = ("bank-dim", "bank-bright", "bank-half-full-well")
_SECOND = {"atrium": "the atrium's six"}


@dataclass(frozen=True)
class Place:
    """A room in a light.

    Attributes:
        title: in tables and figures.
        population: the camera places that its configurations are settings of, in words.
        tables: of its bank, by name without the scene's.
        weights: of the calibration it was judged with, by factor; empty where it is not known.
        commits: the commits of a prospective judgement, by what they did.
        own_light: whether the room has the light of its scene file.
        renders: of each held-out view, with its markers turned otherwise; 0 where it is not known.
    """

    title: str
    population: str
    tables: Tables
    weights: Mapping[str, float] = field(default_factory=dict)
    commits: Mapping[str, str] = field(default_factory=dict)
    own_light: bool = True
    renders: int = 0

    def rows(self, table: str) -> Sequence[CsvRow]:
        """A table's rows; none if there is no such table."""
        return self.tables.get(table, ())

    def ranked(
        self, model: str, metric: str = "", measure: str = SINGLE_FRAME, cameras: str = HEADLINE
    ) -> CsvRow | None:
        """The leaderboard's row of a metric under a noise model (default: the PSS that goes with the measure)."""
        name = metric or _OF_MEASURE.get(measure, "pss-single-frame")
        values = {"cameras": cameras, "measure": measure, "metric": name, "noise_model": model}
        return first_of(self.rows("leaderboard"), **values)

    def less(self, model: str, base: str, measure: str = SINGLE_FRAME) -> CsvRow | None:
        """The row of the paired difference of ρ of the PSS that goes with the measure, by `model` less by `base`."""
        values = {"cameras": HEADLINE, "measure": measure, "metric": _OF_MEASURE[measure]}
        return first_of(self.rows("differences"), **values, noise_model=model, baseline=base)

    def sized(self, model: str, level: str = "single frame") -> CsvRow | None:
        """The row of the table of consistency."""
        values = {} if level == "pixel" else {"cameras": HEADLINE}
        return first_of(self.rows("consistency"), level=level, noise_model=model, **values)

    @property
    def views(self) -> str:
        """How many held-out views its configurations are made of; "" where it is not known."""
        return next((row["views"] for row in self.rows("detection") if row.get("views")), "")

    @property
    def models(self) -> list[str]:
        """The contenders that the leaderboard has, in its order."""
        rows = all_of(self.rows("leaderboard"), cameras=HEADLINE, measure=SINGLE_FRAME)
        return list(dict.fromkeys(row["noise_model"] for row in rows))


def places_of_bank(tables: Tables, title: str = "room", population: str = "the scene's") -> list[Place]:
    """The place of a bank's own tables, and of each further scene, whose name its tables begin with."""
    own = {name: rows for name, rows in tables.items() if name in _NAMES}
    found = [Place(title, population, own)] if "leaderboard" in own else []
    suffix = "-leaderboard"
    for scene in (name.removesuffix(suffix) for name in tables if name.endswith(suffix)):
        others = {name: tables[f"{scene}-{name}"] for name in _NAMES if f"{scene}-{name}" in tables}
        found.append(Place(scene, _SECOND.get(scene, "another scene's"), others))
    return found


def places_of_reference(reference: Path) -> list[Place]:
    """All places of results/reference: the rooms, then the room in other lights, then banks of other names."""
    there = [folder.name for folder in sorted(reference.glob("bank*")) if folder.is_dir()]
    found = []
    for name in [name for name in _BANKS if name in there] + [name for name in there if name not in _BANKS]:
        title, population, renders = _BANKS.get(name, (name.removeprefix("bank-"), "the scene's", 0))
        folder = reference / name
        weights = _weights(folder / "calibrated.toml")
        commits = {row["event"]: row["commit"] for row in read_tables(folder).get("commits", ())}
        for place in places_of_bank(read_tables(folder), title, population):
            own_light = name not in _OTHER_LIGHTS
            found.append(Place(place.title, place.population, place.tables, weights, commits, own_light, renders))
    return found


def _weights(path: Path) -> dict[str, float]:
    if not path.exists():
        return {}
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    return {name: float(weight) for name, weight in content.get("weights", {}).items() if weight}
