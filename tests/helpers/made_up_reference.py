"""A folder like results/reference with made-up numbers: every table that findings are made of, with all its columns.

The numbers follow a rule (how good each contender is, how good each place), so that figures of them look like figures.
"""

from __future__ import annotations

import math
from pathlib import Path

from validate.runs.csv_file import csv_text

__all__ = ["MODELS", "write_reference"]

# How well each contender ranks (ρ), the NEES of its sizes, and predicted over measured RMS.
MODELS = {
    "as-printed": (0.83, 4e-5, 250.0),
    "as-printed, scaled": (0.83, 1.9, 1.3),
    "corrected": (0.90, 1e-5, 400.0),
    "corrected, scaled": (0.90, 1.6, 1.2),
    "identity": (0.84, 2e-4, 70.0),
    "identity, scaled": (0.84, 2.2, 1.1),
    "physical": (0.92, 2.4, 0.9),
    "physical, whole markers": (0.96, 1.35, 0.95),
    "calibrated R": (0.93, 2.2, 0.95),
    "calibrated, limits": (0.98, 1.15, 1.0),
    "calibrated": (0.985, 1.02, 1.0),
}
# Folder and prefix of each place, with what its ρ is lower by.
PLACES = {
    ("bank", ""): 0.0,
    ("bank", "atrium-"): 0.03,
    ("bank-third", ""): 0.02,
    ("bank-dim", ""): 0.06,
    ("bank-bright", ""): 0.02,
    ("bank-half-full-well", ""): 0.04,
}
MEASURES = ("measured_pss_single_frame", "measured_pss_filter", "share_under_0.02mm", "share_under_0.05mm",
              "share_under_0.1mm", "share_under_0.2mm", "share_under_5mm", "median_rms_m")  # fmt: skip
COUNT_RHO = {"single": 0.62, "walk": 0.78}
STEPS_MM = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
C_MM2 = 0.05**2
BINS_MM = (0.03, 0.04, 0.05, 0.07, 0.1, 0.15, 0.25)

Table = list[dict[str, object]]


def write_reference(folder: Path) -> Path:
    """Write all tables below a folder; it again."""
    for (bank, prefix), lower in PLACES.items():
        (folder / bank).mkdir(parents=True, exist_ok=True)
        for name, rows in _bank(lower).items():
            _write(folder / bank / f"{prefix}{name}.csv", rows)
        weights = f'name = "calibrated"\n\n[weights]\nbrightness-contrast = {1.05 + lower}\n'
        (folder / bank / "calibrated.toml").write_text(weights, encoding="utf-8")
    commits = [{"event": "frozen", "commit": "0123abc"}, {"event": "judged", "commit": "4567def"}]
    _write(folder / "bank-third" / "commits.csv", commits)
    _write(folder / "calibration_error.csv", _calibration_error())
    return folder


def _write(path: Path, rows: Table) -> None:
    head = list(dict.fromkeys(key for row in rows for key in row))
    path.write_text(csv_text(head, [[row.get(key, "") for key in head] for row in rows]), encoding="utf-8")


def _around(name: str, value: float, half: float, most: float = math.inf) -> dict[str, object]:
    return {name: value, f"{name}_ci_low": value - half, f"{name}_ci_high": min(value + half, most)}


def _rho(name: str, value: float) -> dict[str, object]:
    return _around(name, value, 0.6 * (1.01 - value) + 0.005, 1.0)


def _bank(lower: float) -> dict[str, Table]:
    return {
        "leaderboard": _leaderboard(lower),
        "differences": _differences(lower),
        "process": _process(lower),
        "consistency": _consistency(lower),
        "size": _size(lower),
        "ceiling": [
            {"cameras": 4, "ceiling": f"{kind}, {what}", **_rho("spearman", 0.99 - lower / 4)}
            for kind in ("ceiling", "oracle", "split halves")
            for what in ("configurations", "points")
        ],
        "parts": [
            {"cameras": 4, "noise_model": model, "visibility": visibility, **_sized(rho - lower, nees, times)}
            for model, (rho, nees, times) in MODELS.items()
            for visibility in ("points", "whole markers", "fitted limits", "known")
        ],
        "sensitivity": [
            {"cameras": 4, "noise_model": "as-printed", "varied": varied, "multiplier": times, **_rho("spearman", 0.8)}
            for varied, times in (("px2_per_m2", 0.1), ("px2_per_m2", 10), ("defocus alone", 1))
        ],
        "scale": [
            {"cameras": 4, "metric": "pss", "measure": "measured_pss_filter", "noise_model": "as-printed",
             "multiplier": times, "fitted": "yes" if times == 1.6e-5 else "no", **_rho("spearman", 0.5 + lower)}
            for times in (1.0, 0.01, 1.6e-5)
        ],
        "detection": [
            {"visibility": kind, "visible_detected": 0.4, "visible_missed": 0.1, "hidden_detected": 0.0,
             "hidden_missed": 0.5, "views": 70, "brier": 0.05, "log_loss": 0.2}
            for kind in ("points", "whole markers")
        ],
        "reliability": [
            {"probability_from": 0.2 * step, "probability_to": 0.2 * step + 0.2, "whole_markers": 100 * step + 50,
             "views": 70, "predicted": 0.1 + 0.2 * step, **_around("found", 0.12 + 0.19 * step - lower, 0.04)}
            for step in range(5)
        ],
        "blunders": [{"cameras": 4, "detections_kept": 1000, "detections_rejected": 1, "rejected_share": 0.001}],
    }  # fmt: skip


def _leaderboard(lower: float) -> Table:
    pairs = [(metric, name, rho) for name, (rho, *_) in MODELS.items() for metric in ("pss", "pss-single-frame")]
    pairs += [
        (metric, name, COUNT_RHO["single"] + better)
        for name in ("physical", "calibrated, limits", "calibrated")
        for metric, better in (("visibility-count", 0.0), ("visible-share", 0.02))
    ]
    rows: Table = []
    for cameras in (2, 4):
        for measure in MEASURES:
            for rank, (metric, name, rho) in enumerate(sorted(pairs, key=lambda pair: -pair[2]), 1):
                neutral = measure != "measured_pss_single_frame" and metric.startswith("pss")
                there = max(rho - lower - 0.4 * neutral, 0.3)
                row = {"cameras": cameras, "measure": measure, "metric": metric, "noise_model": name, "n": 500}
                row |= _rho("spearman", there) | {
                    "rank": rank,
                    "rank_ci_low": max(rank - 2, 1),
                    "rank_ci_high": rank + 3,
                }
                row |= _around("minus_visibility_count", there - COUNT_RHO["single"], 0.1)
                for size in (5, 20, 100):
                    lost = (1 - rho + lower) * 0.5 + size / 4000
                    row |= _around(f"regret_of_{size}_mean", lost, 0.3 * lost)
                    row |= _around(f"oracle_regret_of_{size}_mean", 0.004, 0.002)
                rows.append(row)
    return rows


def _differences(lower: float) -> Table:
    return [
        {"cameras": 4, "measure": measure, "metric": metric, "noise_model": name,
         "baseline": base, "n": 500, **_around("spearman_difference", rho - MODELS[base][0] - lower / 3 - worse, 0.04)}
        for measure, metric, worse in (("measured_pss_single_frame", "pss-single-frame", 0.0),
                                         ("measured_pss_filter", "pss", 0.03))
        for name, (rho, *_) in MODELS.items()
        for base in ("identity", "identity, scaled", "physical")
        if name != base
    ]  # fmt: skip


def _process(lower: float) -> Table:
    rows: Table = []
    for motion in ("random-walk", "constant-velocity"):
        for step in STEPS_MM:
            ratio = step**2 / C_MM2
            level: dict[str, object] = {"process": motion, "step_mm": step if motion == "random-walk" else ""}
            level |= {"acceleration_density_m2_s3": "" if motion == "random-walk" else 0.01 * ratio}
            level |= {
                "time_step_s": 1 / 30,
                "q_over_c": ratio,
                "q_over_c_measured": 1.2 * ratio,
                "cameras": 4,
                "n": 500,
            }
            level |= {"headline": "yes" if step == 0.03 else "no"}
            counted = 0.70 + 0.24 / (1 + 1 / ratio)
            shared = counted - 0.03 + 0.30 * (step == 1.0)
            for name, (rho, *_) in MODELS.items():
                literal = name in ("as-printed", "corrected", "identity")
                there = (0.35 if literal else rho) - lower
                of_both = {
                    "pss": there + 0.05 * (there < 0.9),
                    "visibility-count": counted,
                    "visible-share": min(shared, 0.985 - lower),
                }
                for metric, value in of_both.items():
                    row = {**level, "noise_model": name, "metric": metric, **_rho("spearman", value)}
                    row |= _around("minus_visible_share", value - of_both["visible-share"], 0.03)
                    rows.append(row | _around("minus_visibility_count", value - counted, 0.03))
    return rows


def _consistency(lower: float) -> Table:
    rows: Table = []
    for level in ("pixel", "single frame", "filter, prior", "filter, posterior"):
        for name, (rho, nees, times) in MODELS.items():
            cameras = 1 if level == "pixel" else 4
            row = {
                "level": level,
                "cameras": cameras,
                "noise_model": name,
                **_sized(rho, nees * (1 + 3 * lower), times),
            }
            ratios = {"predicted_axis_ratio_median": 3.0, "measured_axis_ratio_median": 3.5, "axis_angle_median_deg": 6}
            rows.append(row | (ratios if level == "single frame" else {}))
    return rows


def _sized(rho: float, nees: float, times: float) -> dict[str, object]:
    row = _rho("spearman", rho) | _rho("point_spearman", rho - 0.05)
    row |= _around("nees_per_dof", nees, 0.08 * nees) | {f"coverage_{level}": level / 100 for level in (50, 90, 95)}
    return row | {"median_log_ratio": math.log(times), "median_abs_log_ratio": abs(math.log(times)) + 0.1}


def _size(lower: float) -> Table:
    return [
        {"cameras": 4, "noise_model": name, "bin": number, "n": 900, "predicted_rms_m": 1e-3 * mm * times,
         "measured_rms_m": 1e-3 * mm * (1 + lower) * math.sqrt(nees if nees > 0.5 else 1),
         "measured_q25_m": 0.7e-3 * mm, "measured_q75_m": 1.5e-3 * mm * math.sqrt(max(nees, 1))}
        for name, (_, nees, times) in MODELS.items()
        for number, mm in enumerate(BINS_MM)
    ]  # fmt: skip


def _calibration_error() -> Table:
    rows: Table = []
    kinds = (("each frame", "over calibrations"), ("frozen", "within one calibration"), ("frozen", "over calibrations"))
    sizes: list[dict[str, object]] = [{"pan_tilt_deg": 0.0, "focal_share": 0.0, "position_m": 0.0}]
    sizes += [{**sizes[0], name: size} for name in sizes[0] for size in (0.0003, 0.001, 0.003)]
    sizes.append(dict.fromkeys(sizes[0], 0.003))
    for size in sizes:
        largest = max(float(str(value)) for value in size.values())
        for kind, judged in kinds if largest else kinds[:1]:
            for weights in ("own", "with term") if largest else ("own",):
                lost = (0.15 if kind == "each frame" else 0.4) * (largest >= 0.001)
                row = {**size, "kind": kind, "judged": judged, "weights": weights, "n": 500}
                row |= {"draws": 16 if kind == "frozen" else "", "median_pss": 1e4, "median_rms_m": 6e-5 + largest}
                values = {"plain": 0.97 - lost, "with_term": 0.96, "propagated": 0.965, "gain": lost - 0.01}
                values |= {"gain_propagated": lost - 0.005, "other_draws": 0.9, "median_rms": 0.9}
                for name, value in values.items():
                    for end, off in (("", 0.0), ("_low", -0.05), ("_high", 0.02), ("_min", -0.27), ("_max", 0.02)):
                        row[f"spearman_{name}{end}"] = value + off
                row |= {"rms_over_plain": 1 + largest, "rms_over_matching": 1.0, "first_order_rms_ratio": 1.0}
                rows.append(row)
    return rows
