"""The factor sweeps' findings: how errors grow with one factor, predicted and measured, from `slopes.csv`."""

from __future__ import annotations

from validate.findings.tables import Row, all_of, number

__all__ = ["factor_findings"]

MODELS = ("physical", "corrected", "as-printed")
NO_SLOPE = 0.05
# What a sweep varies, in words; others go by their own names.
WORDS = {
    "distance": "distance of a target, with the same lens",
    "distance-same-size": "distance, zoomed so that markers keep their size",
    "ring-distance": "distance, lit by each camera's ring light",
    "incidence": "incidence angle, as its cosine",
    "exposure": "exposure time",
    "aperture": "f-number",
    "resolution": "pixels across the same sensor",
    "cameras": "number of cameras",
}


def factor_findings(rows: list[Row]) -> str:
    """A table of log-log slopes, and a sentence for each model."""
    heads = ("what is varied", "sweep", "measured slope", *MODELS)
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    sweeps = list(dict.fromkeys(row["sweep"] for row in rows))
    for sweep in sweeps:
        of_sweep = {row["noise_model"]: row for row in all_of(rows, sweep=sweep)}
        measured = next(iter(of_sweep.values()))
        slopes = [_slope(of_sweep[model]) if model in of_sweep else "" for model in MODELS]
        lines.append(
            "| " + " | ".join((WORDS.get(sweep, sweep), sweep, number(measured, "measured_slope"), *slopes)) + " |"
        )
    said = []
    for model in MODELS:
        of_model = all_of(rows, noise_model=model)
        inside = [row["sweep"] for row in of_model if _inside(row)]
        off = sorted(abs(float(row["predicted_slope"]) - float(row["measured_slope"])) for row in of_model)
        wrong = [row["sweep"] for row in of_model if _wrong_sign(row)]
        sentence = (
            f"{model}: the slope lies in the measured one's interval in {len(inside)} of {len(of_model)} sweeps, and "
            f"is off by {off[len(off) // 2]:.2f} in the median, {off[-1]:.2f} at the most"
        )
        said.append(sentence + (f"; it has the wrong sign in {', '.join(wrong)}." if wrong else "."))
    return "\n".join(lines) + "\n\n" + "\n".join(f"- {line}" for line in said)


def _inside(row: Row) -> bool:
    low, high = (float(row[f"measured_slope_ci_{end}"]) for end in ("low", "high"))
    return low <= float(row["predicted_slope"]) <= high


def _wrong_sign(row: Row) -> bool:
    """Predicted to grow where it falls, or the other way; a slope of hardly anything has no sign."""
    predicted, low, high = (
        float(row[name]) for name in ("predicted_slope", "measured_slope_ci_low", "measured_slope_ci_high")
    )
    return abs(predicted) > NO_SLOPE and ((predicted > 0 and high < 0) or (predicted < 0 and low > 0))


def _slope(row: Row) -> str:
    return f"{float(row['predicted_slope']):.2f}".replace("-", "−")
