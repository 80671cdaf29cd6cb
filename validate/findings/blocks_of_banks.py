"""Parts of the README on the banks: every contender in every room and light, and what follows, with its population."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pss.noise import CALIBRATION_FACTORS, Calibration
from validate.findings.blocks_of_sweeps import table_text
from validate.findings.calibration_error import calibration_error_sentences
from validate.findings.tables import Row, Tables, all_of, number, percent, read_tables

__all__ = ["BANK_BLOCKS"]

CAMERAS = "4"
FRAME, FILTER = "measured_pss_single_frame", "measured_pss_filter"
PSS, COUNT = "pss-single-frame", "visibility-count"
# (folder, what the tables' names begin with, title)
BANKS = (
    ("bank", "", "room"),
    ("bank", "atrium-", "second room"),
    ("bank-third", "", "third room"),
    ("bank-dim", "", "room, light × ¼"),
    ("bank-bright", "", "room, light × 4"),
    ("bank-half-full-well", "", "room, half of full well"),
)
CONTENDERS = (
    "as-printed",
    "as-printed, scaled",
    "corrected",
    "corrected, scaled",
    "identity",
    "identity, scaled",
    "physical",
    "physical, whole markers",
    "calibrated R",
    "calibrated, limits",
    "calibrated",
)
# Factors of a calibration that are not the paper's, nor made of its quantities.
OWN_FACTORS = ("brightness-contrast", "floor")
PAPER = [name for name in CALIBRATION_FACTORS if name not in OWN_FACTORS]
NONE = "–"


@dataclass(frozen=True)
class Bank:
    """A room in a light."""

    title: str
    tables: Tables
    prefix: str

    def rows(self, table: str, **wanted: str) -> list[Row]:
        """Of four cameras; columns that an earlier version's table lacks match nothing."""
        rows = self.tables.get(self.prefix + table, [])
        return [
            row for row in rows if all(row.get(key) == value for key, value in {"cameras": CAMERAS, **wanted}.items())
        ]

    def ranked(self, model: str, metric: str = PSS, yardstick: str = FRAME) -> Row | None:
        """Of the leaderboard."""
        found = self.rows("leaderboard", noise_model=model, metric=metric, yardstick=yardstick)
        return found[0] if found else None


def _banks(reference: Path) -> list[Bank]:
    tables = {folder: read_tables(reference / folder) for folder in dict.fromkeys(folder for folder, *_ in BANKS)}
    banks = (Bank(title, tables[folder], prefix) for folder, prefix, title in BANKS)
    return [bank for bank in banks if bank.rows("leaderboard")]


def _models(banks: Sequence[Bank]) -> list[str]:
    return [name for name in CONTENDERS if any(bank.ranked(name) for bank in banks)]


def _number(row: Row | None, name: str) -> str:
    return number(row, name) if row is not None and row.get(name) else NONE


def _ranks(reference: Path) -> str:
    """ρ of single-frame PSS for every contender in every room and light, and of the count of visible points."""
    banks = _banks(reference)
    lines = [[name, *(_number(bank.ranked(name), "spearman") for bank in banks)] for name in _models(banks)]
    lines.append(
        ["(count of visible points)", *(_number(bank.ranked("physical", COUNT), "spearman") for bank in banks)]
    )
    return table_text(["R", *(bank.title for bank in banks)], lines)


def _neutral(reference: Path) -> str:
    """ρ of each contender by every yardstick, in the room."""
    room = _banks(reference)[0]
    yardsticks = list(dict.fromkeys(row["yardstick"] for row in room.rows("leaderboard")))
    yardsticks = sorted((name for name in yardsticks if name != FILTER), key=_order)
    asked = [*((model, PSS) for model in _models([room])), ("physical", COUNT)]
    lines = []
    for model, metric in asked:
        found = [room.ranked(model, metric, name) for name in yardsticks]
        title = model if metric == PSS else "(count of visible points)"
        lines.append([title, *(_number(row, "spearman") for row in found)])
    return table_text(["R", *map(_words, yardsticks)], lines)


def _order(yardstick: str) -> tuple[int, float]:
    """Measured PSS first, then shares by their threshold, then the median."""
    return (0, 0.0) if yardstick == FRAME else (1, _millimetres(yardstick)) if "share" in yardstick else (2, 0.0)


def _millimetres(yardstick: str) -> float:
    return float(yardstick.removeprefix("share_under_").removesuffix("mm"))


def _words(yardstick: str) -> str:
    if yardstick.startswith("share_under_"):
        return f"within {_millimetres(yardstick):g} mm"
    return {FRAME: "measured PSS", "median_rms_m": "median RMS"}.get(yardstick, yardstick)


def _printed(reference: Path) -> str:
    """The paper's R as printed beside R = I."""
    said, better = [], []
    for bank in _banks(reference):
        printed, identity = bank.ranked("as-printed"), bank.ranked("identity")
        if printed is None or identity is None:
            continue
        difference = _number(printed, "minus_identity")
        less = "" if difference == NONE else f" (difference {difference})"
        said.append(f"{bank.title} {_number(printed, 'spearman')} against {_number(identity, 'spearman')}{less}")
        low = printed.get("minus_identity_ci_low") or float(printed["spearman_ci_low"]) - float(identity["spearman"])
        better.append(float(low) > 0)
    verb = "ranks better than R = I in some" if any(better) else "does not rank better than R = I in any"
    return f"As printed, the paper's R {verb} of {len(said)} rooms and lights: {'; '.join(said)}"


def _sizes(reference: Path) -> str:
    """NEES of the calibrated prediction, a point's three coordinates in a single frame."""
    said = []
    for bank in _banks(reference):
        found = bank.rows("consistency", level="single frame", noise_model="calibrated")
        if found:
            said.append(f"{bank.title} {_number(found[0], 'nees_per_dof')}")
    return f"NEES/3, calibrated, is {'; '.join(said)}"


def _process(reference: Path) -> str:
    """σ∞ beside the count of visible points, where process and measurement weigh alike if that was judged."""
    said = []
    for bank in _banks(reference):
        rows = all_of(bank.tables.get(f"{bank.prefix}process", []))
        headline = [row for row in rows if row.get("headline") == "yes" and row["metric"] == "pss"]
        for row in headline:
            if row["noise_model"] == "calibrated":
                process = row.get("process", "").replace("-", " ")
                more = _number(row, "minus_visibility_count")
                rho = _number(row, "spearman")
                said.append(f"{bank.title}, {process} {rho}, {more} more than that of the visibility count")
    if said:
        return f"Where process and measurement weigh alike, ρ of σ∞, calibrated, is {'; '.join(said)}"
    for bank in _banks(reference)[:1]:
        own, count = bank.ranked("calibrated", "pss", FILTER), bank.ranked("calibrated", "visible-share", FILTER)
        said.append(f"{bank.title} {_number(own, 'spearman')} against {_number(count, 'spearman')}")
    return (
        "σ∞ has been judged only at 1 mm of process noise a frame, where it is nearly a count of points (calibrated, "
        f"against the share of points that two cameras see: {'; '.join(said)})"
    )


def _under(reference: Path) -> str:
    """How calibrated PSS ranks by the share of points within 5 mm."""
    room = _banks(reference)[0]
    row = room.ranked("calibrated", PSS, "share_under_5mm")
    if row is None:
        return f"ρ = {NONE}"
    others = sum(bool(other["spearman"]) for other in room.rows("leaderboard", yardstick="share_under_5mm"))
    rank = f"{row['rank']} [{row['rank_ci_low']}, {row['rank_ci_high']}]"
    return f"ρ = {_number(row, 'spearman')} and the rank {rank} of {others}"


def _tied(reference: Path) -> str:
    """How many pairs of metric and noise model reach into the rank of calibrated PSS."""
    room = _banks(reference)[0]
    own = room.ranked("calibrated")
    if own is None:
        return NONE
    low, high = int(own["rank_ci_low"]), int(own["rank_ci_high"])
    rows = [row for row in room.rows("leaderboard", yardstick=FRAME) if row is not own and row["spearman"]]
    return str(sum(int(row["rank_ci_low"]) <= high and low <= int(row["rank_ci_high"]) for row in rows))


def _missed(reference: Path) -> str:
    """Of all pairs of a view and a marker, those predicted visible and missed, by what counts as visible."""
    rows = read_tables(reference / "bank")["detection"]
    return ", ".join(f"{percent(row['visible_missed'])} by {row['visibility']}" for row in rows)


def _weights(reference: Path) -> str:
    """Which of the paper's factors the calibrations give a weight."""
    fitted = {}
    for folder in dict.fromkeys(folder for folder, *_ in BANKS):
        path = reference / folder / "calibrated.toml"
        if path.exists():
            fitted[folder] = Calibration.from_file(path).weights
    names = sorted({name for weights in fitted.values() for name, w in weights.items() if w > 0 and name in PAPER})
    if names:
        return f"Of the paper's factors the {len(fitted)} calibrations give a weight to {', '.join(names)}"
    return f"None of the {len(fitted)} calibrations gives a factor of the paper any weight"


def _calibration_errors(reference: Path) -> str:
    return calibration_error_sentences(read_tables(reference)["calibration_error"])


BANK_BLOCKS: Mapping[str, Callable[[Path], str]] = {
    "banks: as printed": _printed,
    "banks: ranks": _ranks,
    "banks: neutral": _neutral,
    "banks: sizes": _sizes,
    "banks: process": _process,
    "banks: weights": _weights,
    "banks: within 5 mm": _under,
    "banks: tied": _tied,
    "banks: missed": _missed,
    "calibration errors: sentences": _calibration_errors,
}
