"""A run of two configurations."""

from __future__ import annotations

import json

from validate.runs.tables import write_csv


def a_run(folder, exposure_ms=4.0, pss=(100.0, 200.0), names=("zoom=1", "zoom=2"), zoom=3.0):
    """A folder as a run leaves it, with two steps and two noise models."""
    rows = [
        {
            "sweep": "zoom", "configuration": name, "parameter": "zoom", "value": name[5:], "cameras": 2,
            "noise_model": model, "pss": 10.0, "pss_single_frame": 20.0 * factor,
            "measured_pss_single_frame": value, "measured_pss_ci_low": 0.9 * value,
            "measured_pss_ci_high": 1.1 * value,
        }
        for model, factor in (("as-printed", 1.0), ("physical", 3.0))
        for name, value in zip(names, pss, strict=True)
    ]  # fmt: skip
    write_csv(folder / "configurations.csv", rows)
    scene = {"sensor": {"exposure_ms": exposure_ms}, "cameras": [{"name": "1", "zoom": zoom}]}
    record = {"scenes": {"zoom": scene, "focus": scene}, "sweeps": {"zoom": {"seed": 1}}, "seconds": {"total": pss[0]}}
    (folder / "run.json").write_text(json.dumps(record))
    return folder
