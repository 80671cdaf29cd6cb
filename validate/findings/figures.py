"""The findings' figures, for the page and for print; every contender in every place, in one order and colour."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from pss.hints import CsvRow
from render.store.folder import atomic_path
from validate.findings.contenders import Contender, contenders_in
from validate.findings.detection_figure import detection_curves, detection_figure
from validate.findings.forest import Axis, Mark, Panel, forest, mark_of, style
from validate.findings.places import COUNT, HEADLINE, SINGLE_FRAME, Place
from validate.findings.process_figure import COUNTED_BY, SHARE, headline_levels, process_curves, process_figure
from validate.findings.sigma_figure import SIGMA_AXIS, sigma_rows
from validate.findings.size_figure import size_curves, size_figure
from validate.plots.drawing import plt
from validate.runs.csv_file import all_of, bounds, first_of
from validate.runs.palette import DARK_INK

__all__ = ["DIGEST", "Drawing", "drawings_of", "write_pdf", "write_svg"]

# Of the page's width, for print: 7 inches, with words of 7 pt.
PRINT_SCALE = 7.0 / 11.0
COUNT_ROW, SHARE_ROW, CEILING_ROW = "count of visible points", "share that two see", "ceiling"
CEILINGS = ("ceiling, configurations", "split halves, configurations")
DIGEST = "made from "
PERCENT = 100.0
# NEES over its degrees of freedom that is called right, and the range of the axis.
RIGHT, NEES_RANGE = (0.9, 1.1), (0.4, 8.0)
# In percent; an interval that ends beyond it has an arrow.
REGRET_RANGE = (0.0, 30.0)
RHO_TICKS = (-0.5, 0.0, 0.5, 0.8, 0.95, 0.99, 0.998)
HIGHEST_RHO = 0.999


@dataclass(frozen=True)
class Drawing:
    """A figure that can be drawn at a scale.

    Attributes:
        name: of the file, without ending.
        alt: what is seen, for those who do not see it.
        caption: below it on the page.
        data: the numbers that are in it.
        draw: at a scale, 1 for the page.
    """

    name: str
    alt: str
    caption: str
    data: str
    draw: Callable[[float], Figure]

    @property
    def file(self) -> str:
        """The page's file."""
        return f"{self.name}.svg"

    @property
    def digest(self) -> str:
        """Of the numbers, the same on every machine, which the bytes of a drawing are not."""
        return hashlib.sha256(f"{self.name}\n{self.data}".encode()).hexdigest()[:16]


def drawings_of(places: Sequence[Place]) -> list[Drawing]:
    """Those that there are tables for."""
    makers = (_ranking, _process, _sigma, _regret, _size, _nees, _detection)
    return [drawing for maker in makers if (drawing := maker(places)) is not None]


def write_svg(drawing: Drawing, folder: Path) -> Path:
    """For the page; its description holds the digest of the numbers."""
    return _write(drawing, folder / drawing.file, 1.0, {"Date": None, "Description": DIGEST + drawing.digest})


def write_pdf(drawing: Drawing, folder: Path) -> Path:
    """For print, 7 inches wide, with its fonts."""
    return _write(drawing, folder / f"{drawing.name}.pdf", PRINT_SCALE, {"CreationDate": None})


def _write(drawing: Drawing, path: Path, scale: float, metadata: dict[str, str | None]) -> Path:
    figure = drawing.draw(scale)
    with style(scale), atomic_path(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], metadata=metadata)
    plt.close(figure)
    return path


def _ranking(places: Sequence[Place]) -> Drawing | None:
    def marks(place: Place, model: Contender) -> Mark | None:
        return mark_of(place.ranked(model.name), "spearman", model)

    extra = {COUNT_ROW: partial(_counted, metric=COUNT), SHARE_ROW: partial(_counted, metric=SHARE)}
    extra |= {CEILING_ROW: _ceiling}
    found = [place.ranked(model) for place in places for model in place.models]
    found += [_counted(place, metric) for place in places for metric in (COUNT, SHARE)]
    known = [value for row in found for value in bounds(row, "spearman") if not math.isnan(value)]
    low = math.floor(10 * min(known, default=0.0)) / 10
    label = "Spearman's ρ with measured PSS (axis of Fisher's z, which opens up what is near 1)"
    axis = Axis(label, max(low, RHO_TICKS[0]), HIGHEST_RHO, tuple(tick for tick in RHO_TICKS if tick >= low), "fisher")
    return _forest(
        "findings-ranking",
        "Does it rank? Single-frame PSS against measured PSS, four cameras",
        "Forest plot: rank correlation of each R with measured single-frame PSS, in each room and light.",
        "**Ranking.** ρ of single-frame PSS with measured PSS within four cameras, with 95 % intervals. The ceiling is "
        "what a perfect prediction reaches, or, in tables without it, one half of the trials by the other. A scalar "
        "times R changes nothing here. The axis is one of Fisher's z.",
        places, marks, extra, axis,
    )  # fmt: skip


def _counted(place: Place, metric: str) -> CsvRow | None:
    """The row of a count, by what the best contender that has one takes as visible."""
    return next(filter(None, (place.ranked(model, metric) for model in COUNTED_BY)), None)


def _ceiling(place: Place) -> CsvRow | None:
    found = (first_of(place.rows("ceiling"), cameras=HEADLINE, ceiling=name) for name in CEILINGS)
    return next((row for row in found if row), None)


def _sigma(places: Sequence[Place]) -> Drawing | None:
    labels, groups, panels = sigma_rows(places)
    if not panels:
        return None
    title = "Is σ∞ more than a count? Where process and measurement noise weigh alike (q ≈ c)"
    return Drawing(
        "findings-sigma",
        "Forest plot: rank correlation of σ∞ less that of two counts of points, by motion, R and place.",
        "**σ∞ less counting.** At the judged level of each motion. Right of the line σ∞ ranks better than the count of "
        "visible points (filled), than the share that two cameras see (hollow); it is more than a count where both "
        "intervals are there.",
        _numbers(labels, panels),
        lambda scale: forest(title, labels, groups, panels, SIGMA_AXIS, scale),
    )


def _regret(places: Sequence[Place]) -> Drawing | None:
    def marks(place: Place, model: Contender) -> Mark | None:
        return mark_of(place.ranked(model.name), "regret_of_20_mean", model, PERCENT)

    def oracle(place: Place) -> CsvRow | None:
        rows = all_of(place.rows("leaderboard"), cameras=HEADLINE, measure=SINGLE_FRAME, metric="pss-single-frame")
        return rows[0] if rows else None

    extra = {"oracle": oracle}
    return _forest(
        "findings-regret",
        "What does choosing by it cost? The best of 20 by single-frame PSS",
        "Forest plot: mean regret of choosing the best of 20 configurations by each R, in each room and light.",
        "**Regret.** What the chosen one of 20 loses of the best measured PSS, in the mean, beside the oracle, who "
        "chooses by the other half of the trials. An arrow is an interval that goes on.",
        places, marks, extra, Axis("mean regret, % of the best measured PSS", *REGRET_RANGE, (0, 10, 20, 30)),
        extra_column="oracle_regret_of_20_mean", factor=PERCENT,
    )  # fmt: skip


def _nees(places: Sequence[Place]) -> Drawing | None:
    def marks(place: Place, model: Contender) -> Mark | None:
        return mark_of(place.sized(model.name), "nees_per_dof", model)

    axis = Axis("NEES/3 of single-frame errors (1 is right; above it errors are larger than predicted)", *NEES_RANGE,
                (0.5, 1, 2, 4, 8), "log", band=RIGHT, line=1.0)  # fmt: skip
    return _forest(
        "findings-nees",
        "Is the error as large as predicted?",
        "Forest plot: NEES over its degrees of freedom of single-frame errors, by R, in each room and light.",
        "**Size.** NEES over its degrees of freedom; the band is 0.9 to 1.1. An arrow at the edge has the number of "
        "what is beyond it.",
        places, marks, {}, axis,
    )  # fmt: skip


def _forest(
    name: str,
    title: str,
    alt: str,
    caption: str,
    places: Sequence[Place],
    marks: Callable[[Place, Contender], Mark | None],
    extra: dict[str, Callable[[Place], CsvRow | None]],
    axis: Axis,
    extra_column: str = "spearman",
    factor: float = 1.0,
) -> Drawing | None:
    models = contenders_in(model for place in places for model in place.models)
    panels = []
    for place in places:
        of_place = [marks(place, model) for model in models]
        if not any(of_place):
            continue
        for find in extra.values():
            of_place.append(mark_of(find(place), extra_column, _BESIDE, factor))
        panels.append(Panel(place.title, tuple(of_place)))
    rows = [model.name for model in models] + list(extra)
    groups = [model.colour for model in models] + ["beside"] * len(extra)
    kept = [place for place in range(len(rows)) if any(panel.marks[place] for panel in panels)]
    if not kept:
        return None
    labels, groups = [rows[place] for place in kept], [groups[place] for place in kept]
    panels = [Panel(panel.title, tuple(panel.marks[place] for place in kept)) for panel in panels]
    numbers = _numbers(labels, panels)
    return Drawing(name, alt, caption, numbers, lambda scale: forest(title, labels, groups, panels, axis, scale))


def _numbers(labels: Sequence[str], panels: Sequence[Panel]) -> str:
    lines = (
        panel.title + ": " + "; ".join(mark.text if mark else "" for mark in panel.marks + panel.second)
        for panel in panels
    )
    return "\n".join([", ".join(labels), *lines])


_BESIDE = Contender("beside", DARK_INK, "X", True)


def _process(places: Sequence[Place]) -> Drawing | None:
    curves, judged = process_curves(places), headline_levels(places)
    if not curves:
        return None
    return Drawing(
        "findings-process",
        "Curves: rank correlation of PSS by σ∞ and of two counts of points over the ratio of process noise to "
        "measurement noise.",
        "**Process noise.** ρ of σ∞ with the filter's measured PSS over q/c, the variance of the process over that of "
        "the measurement, a frame, for the rooms in their own light, beside the count of visible points and the share "
        "that two cameras are expected to find. Shaded: 95 % intervals of the calibrated and of that share, which are "
        "one curve on the far right. The axis of ρ is one of Fisher's z.",
        "\n".join([*map(str, curves), *(f"{panel}: {level:.4g}" for panel, level in judged.items())]),
        lambda scale: process_figure(curves, judged, scale),
    )


def _size(places: Sequence[Place]) -> Drawing | None:
    curves = size_curves(places)
    if not curves:
        return None
    return Drawing(
        "findings-size",
        "Measured over predicted error of points by the predicted one, a panel for each room and light; at 1 they "
        "agree.",
        "**Predicted and measured error.** Medians of the measured RMS of points over the predicted, in bins of the "
        "predicted; quartiles are shaded where it is calibrated. Contenders off the axes are named, with their median.",
        "\n".join(map(str, curves)),
        lambda scale: size_figure(curves, scale),
    )


def _detection(places: Sequence[Place]) -> Drawing | None:
    curves = detection_curves(places)
    if not curves:
        return None
    return Drawing(
        "findings-detection",
        "Share of whole markers found over the predicted probability of detection, a panel for each room and light; on "
        "the diagonal they agree.",
        "**Detection.** The share of whole markers that were found, in bins of the predicted probability, with 95 % "
        "intervals.",
        "\n".join(map(str, curves)),
        lambda scale: detection_figure(curves, scale),
    )
