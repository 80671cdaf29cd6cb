"""Made-up runs to lay side by side."""

from __future__ import annotations

import json

from validate.runs.tables import write_csv

MODELS = ("as-printed", "physical")
STEPS = ("1", "2", "4")
LONG = "a-run-whose-name-is-so-long-that-no-head-of-any-table-could-ever-hold-it-whole"


def a_run(folder, factor=1.0, predicted=1.0, spread=0.1, rho=0.8, half_width=0.1, exposure_ms=4.0, sweep="zoom"):
    """A folder as a run leaves it: measured PSS `factor` and the physical prediction `predicted` times as large.

    Args:
        spread: half the interval of measured PSS over its value; nan for no interval.
        half_width: the same of ρ, in ρ.
    """
    rows, points, correlation = [], [], []
    for model in MODELS:
        for number, value in enumerate(STEPS):
            measured = 100.0 * (1 + number) * factor
            rms = 1e-3 / (1 + number) / factor
            times = predicted if model == "physical" else 1.0
            rows.append(
                {
                    "sweep": sweep, "configuration": f"zoom={value}", "parameter": "zoom", "value": value, "cameras": 2,
                    "noise_model": model, "pss": 10.0 * times, "pss_single_frame": 20.0 * (number + 1) * times,
                    "predicted_rms_m": 0.01 / times, "sigma_inf_rms_m": 0.02 / times,
                    "measured_pss_single_frame": measured, "measured_pss_ci_low": (1 - spread) * measured,
                    "measured_pss_ci_high": (1 + spread) * measured, "measured_pss_filter": measured / 3,
                    "measured_rms_m": rms, "measured_rms_ci_low_m": (1 - spread) * rms,
                    "measured_rms_ci_high_m": (1 + spread) * rms, "share_under_5mm": 0.5,
                }
            )  # fmt: skip
            points += [
                {"sweep": sweep, "configuration": f"zoom={value}", "noise_model": model, "point": point,
                 "object": "board", "x_m": 0.1 * point, "y_m": 0.2, "z_m": 1.0, "measured_rms_m": rms * (1 + point)}
                for point in range(4)
            ]  # fmt: skip
        for metric in ("pss", "pss-single-frame", "visible-share"):
            correlation.append(
                {
                    "sweep": sweep, "metric": metric, "noise_model": model, "level": "configuration",
                    "measure": "measured_pss_single_frame", "cameras": 2, "n": 3, "spearman": rho,
                    "spearman_ci_low": rho - half_width, "spearman_ci_high": rho + half_width, "regret": 0.05,
                }
            )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "configurations.csv", rows)
    write_csv(folder / "points.csv", points)
    write_csv(folder / "correlation.csv", correlation)
    scene = {"sensor": {"exposure_ms": exposure_ms}, "cameras": [{"name": "1", "zoom": 3.0}]}
    record = {"scenes": {sweep: scene}, "sweeps": {sweep: {"seed": 1}}, "versions": {"numpy": "2"}}
    (folder / "run.json").write_text(json.dumps(record))
    return str(folder)
