"""Tables of how contenders and metrics rank: every contender in every place, nothing left out."""

from __future__ import annotations

from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.contenders import contenders_in
from validate.findings.places import COUNT, FILTER, HEADLINE, SHARE, SINGLE_FRAME, Place
from validate.findings.process import COUNTED_BY, MOTIONS, at_headline, at_the_scenes
from validate.runs.csv_file import all_of, bounds, value_of
from validate.runs.numbers import NOTHING, number, percent_with_range
from validate.runs.table_text import markdown_table

__all__ = ["ceiling_table", "count_table", "difference_table", "neutral_table", "ranking_table", "regret_table"]

# With 100 of 500 there are so few choices that the interval is nearly all of 0 to 100 %.
CHOICES = (5, 20)
FRAME, SCENES = "single frame", "σ∞, random walk of 1 mm"
KINDS = {FRAME: "", **{f"σ∞ at q ≈ c, {words}": motion for motion, words in MOTIONS.items()}, SCENES: ""}


def ranking_table(places: Sequence[Place]) -> str:
    """ρ of single-frame PSS and of σ∞ for each contender in each place; the count of visible points below."""
    rows = []
    for model in _models(places):
        for kind in KINDS:
            cells = [number(_row(place, model, kind), "spearman") for place in places]
            rows.append([model, kind, *cells])
    for model in COUNTED_BY:
        for metric, words in ((COUNT, "count of cameras, at most three"), (SHARE, "share that two cameras see")):
            for kind in KINDS:
                counts = [_row(place, model, kind, metric) for place in places]
                rows.append([f"({words}: {model})", kind, *(number(row, "spearman") for row in counts)])
    return _without_empty(["R", "PSS", *(place.title for place in places)], rows, 2)


def difference_table(places: Sequence[Place]) -> str:
    """Paired differences of ρ: to other R with the same metric, and to the count of what the contender sees."""
    rows = []
    models = _models(places)
    bases = list(dict.fromkeys(row["baseline"] for place in places for row in place.rows("differences")))
    for model in models:
        for base in bases:
            for kind, measure in ((FRAME, SINGLE_FRAME), (SCENES, FILTER)):
                less = [place.less(model, base, measure) for place in places]
                cells = [_difference(row) for row in less]
                rows.append([model, kind, base, *cells])
        for kind in KINDS:
            found = [_row(place, model, kind) for place in places]
            for words, column in (("count of cameras", "minus_visibility_count"), ("share", "minus_visible_share")):
                rows.append([model, kind, words, *(number(row, column) for row in found)])
    return _without_empty(["R", "PSS", "less that of", *(place.title for place in places)], rows, 3)


def _difference(row: CsvRow | None) -> str:
    """A paired difference of ρ; nothing where both rank alike by construction."""
    value, low, high = bounds(row, "spearman_difference")
    return NOTHING if value == low == high == 0 else number(row, "spearman_difference")


def regret_table(places: Sequence[Place]) -> str:
    """Mean regret of choosing one of 5 and of 20 by single-frame PSS, and the oracle's."""
    rows = []
    for size in CHOICES:
        name = f"regret_of_{size}_mean"
        for model in _models(places):
            cells = [percent_with_range(place.ranked(model), name) for place in places]
            rows.append([f"{size}", model, *cells])
        any_row = [next((row for m in place.models if (row := place.ranked(m))), None) for place in places]
        rows.append([f"{size}", "(oracle)", *(percent_with_range(row, f"oracle_{name}") for row in any_row)])
    return _without_empty(["one of", "R", *(place.title for place in places)], rows, 2)


def neutral_table(place: Place) -> str:
    """ρ and rank of every pair of metric and contender by every measure, in a place, best by the first on top."""
    board = all_of(place.rows("leaderboard"), cameras=HEADLINE)
    measures = list(dict.fromkeys(row["measure"] for row in board))
    order = {SINGLE_FRAME: 0, FILTER: 2}
    measures.sort(key=lambda name: (order.get(name, 1), _threshold_mm(name)))
    by_pair: dict[tuple[str, str], dict[str, CsvRow]] = {}
    twins: dict[str, dict[str, None]] = {}
    for row in board:
        if twin := row.get("equivalent_to"):
            twins.setdefault(twin, {})[_named(row["metric"], row["noise_model"])] = None
            continue
        by_pair.setdefault((row["metric"], row["noise_model"]), {})[row["measure"]] = row
    ranked = [pair for pair, rows in by_pair.items() if any(row.get("spearman") for row in rows.values())]
    ranked.sort(key=lambda pair: -_or_lowest(value_of(by_pair[pair].get(SINGLE_FRAME), "spearman")))
    rows = []
    for pair in ranked:
        same = ", ".join(twins.get(_named(*pair), ()))
        rows.append([*pair, *(_with_rank(by_pair[pair].get(name)) for name in measures), same])
    table = markdown_table(["metric", "R", *map(_words, measures), "the same order"], rows)
    without = [pair for pair in by_pair if pair not in ranked]
    named = [name for pair in without for own in [_named(*pair)] for name in (own, *twins.get(own, ()))]
    return table + f"\n\nThe same for all configurations, so that they order none: {', '.join(named)}." * bool(named)


def _named(metric: str, model: str) -> str:
    return f"{metric} ({model})"


def _threshold_mm(measure: str) -> float:
    try:
        return float(measure.removeprefix("share_under_").removesuffix("mm"))
    except ValueError:
        return float("inf")


def _words(measure: str) -> str:
    words = {SINGLE_FRAME: "measured PSS, single frame", FILTER: "measured PSS, filter", "median_rms_m": "median RMS"}
    return words.get(measure, measure.replace("_", " ").replace("mm", " mm"))


def _with_rank(row: CsvRow | None) -> str:
    if row is None or not row.get("spearman"):
        return NOTHING
    rank = f"{row['rank']} [{row['rank_ci_low']}, {row['rank_ci_high']}]" if row.get("rank") else NOTHING
    return f"{number(row, 'spearman')}; {rank}"


def _or_lowest(value: float) -> float:
    return value if value == value else -2.0


def count_table(places: Sequence[Place]) -> str:
    """ρ of single-frame PSS by the number of cameras."""
    rows = []
    for place in places:
        counts = sorted({row["cameras"] for row in place.rows("leaderboard")}, key=int)
        for model in _models([place]):
            cells = {count: number(place.ranked(model, cameras=count), "spearman") for count in counts}
            rows.append([place.title, model, *(cells.get(count, NOTHING) for count in ("2", "3", "4", "6"))])
    more = [row for row in rows if sum(cell != NOTHING for cell in row[2:]) > 1]
    return markdown_table(["where", "R", *(f"{count} cameras" for count in (2, 3, 4, 6))], more)


def ceiling_table(places: Sequence[Place]) -> str:
    """ρ of the oracle, from the pixel errors of one half of the trials, and of one half against the other."""
    names = list(dict.fromkeys(row["ceiling"] for place in places for row in place.rows("ceiling")))
    rows = []
    for name in names:
        found = [all_of(place.rows("ceiling"), cameras=HEADLINE, ceiling=name) for place in places]
        rows.append([name, *(number(each[0] if each else None, "spearman") for each in found)])
    return markdown_table(["ceiling", *(place.title for place in places)], rows)


def _models(places: Sequence[Place]) -> list[str]:
    return [contender.name for contender in contenders_in(model for place in places for model in place.models)]


def _row(place: Place, model: str, kind: str, metric: str = "") -> CsvRow | None:
    if kind == FRAME:
        return place.ranked(model, metric)
    if kind == SCENES:
        return at_the_scenes(place, model, metric or "pss")
    return at_headline(place, model, KINDS[kind], metric or "pss")


def _without_empty(heads: Sequence[str], rows: Sequence[Sequence[str]], names: int) -> str:
    """A table without the rows in which no place has a number."""
    return markdown_table(heads, [row for row in rows if any(cell != NOTHING for cell in row[names:])])
