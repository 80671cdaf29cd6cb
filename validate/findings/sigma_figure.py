"""ρ of σ∞ less that of two counts of points, at q ≈ c: a forest plot with a heading for each kind of motion."""

from __future__ import annotations

from collections.abc import Sequence

from validate.findings.contenders import Contender, contenders_in
from validate.findings.forest import INDENT, Axis, Mark, Panel, mark_of
from validate.findings.places import Place
from validate.findings.process import MOTIONS, at_headline

__all__ = ["SIGMA_AXIS", "sigma_rows"]

# Models of open unit in the unit that fits, and the paper's as it stands; the table has all.
SHOWN = ("as-printed", "as-printed, scaled", "corrected, scaled", "identity, scaled", "physical")
SHOWN += ("physical, whole markers", "calibrated")
SIGMA_AXIS = Axis(
    "ρ of σ∞ less ρ of (●) the count of visible points, (◇) the share that two cameras see; both the contender's own",
    -0.25,
    0.25,
    (-0.2, -0.1, 0.0, 0.1, 0.2),
    line=0.0,
)


def sigma_rows(places: Sequence[Place]) -> tuple[list[str], list[str], list[Panel]]:
    """Labels of the rows, groups of them, and a panel for each place that has process noise as a factor."""
    labels, groups = [], []
    models = contenders_in(SHOWN)
    for words in MOTIONS.values():
        labels += [words, *(INDENT + model.name for model in models)]
        groups += [words] * (1 + len(models))
    panels = []
    for place in places:
        first, second = (_marks(place, models, column) for column in ("minus_visibility_count", "minus_visible_share"))
        if any(first):
            panels.append(Panel(place.title, tuple(first), tuple(second)))
    return labels, groups, panels


def _marks(place: Place, models: Sequence[Contender], column: str) -> list[Mark | None]:
    count = column == "minus_visibility_count"
    found: list[Mark | None] = []
    for motion in MOTIONS:
        found.append(None)
        for model in models:
            shown = Contender(model.name, model.colour, "o" if count else "D", count)
            found.append(mark_of(at_headline(place, model.name, motion), column, shown))
    return found
