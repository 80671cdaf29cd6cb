"""All tables of a held-out bank, from one judgement of its configurations for each count of cameras."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pss.hints import Row
from pss.noise import Calibration
from validate.acquire.acquire import Acquired
from validate.bank.ceilings import oracle_rows, parts_rows
from validate.bank.consistency_rows import blunder_row, consistency_rows, pixel_rows
from validate.bank.design import ViewBank
from validate.bank.detected import detection_rows, reliability_rows
from validate.bank.differences import difference_rows
from validate.bank.filtered import filter_all
from validate.bank.judge import data_of, requested_pairs, verdict_of
from validate.bank.leaderboard import leaderboard
from validate.bank.process_noise import process_rows
from validate.bank.sensitivity import scale_rows, sensitivity_rows
from validate.bank.size_bins import size_rows
from validate.prediction.contenders import (
    BASES,
    detection_model_of,
    noise_models,
    own_models,
    scene_contenders,
    visibilities,
)
from validate.prediction.process_levels import Level

__all__ = ["HEADLINE", "judge"]


# The camera count whose configurations are tracked by the filter as well, and the one of the headline.
HEADLINE = 4


def judge(
    bank: ViewBank,
    acquired: Acquired,
    calibration: Calibration,
    configurations: int,
    seed: int,
    counts: tuple[int, ...],
    levels: Sequence[Level],
    report: Callable[[str], None] = lambda line: None,
) -> dict[str, list[Row]]:
    """Tables of a held-out bank by name; the filter at `levels` of process noise; `report` is called with progress."""
    data = data_of(bank, acquired, seed)
    models, contenders = noise_models(bank.scene, calibration), scene_contenders(bank.scene, calibration)
    rows: dict[str, list[Row]] = {"leaderboard": [], "ceiling": [], "consistency": [], "detection": [], "parts": []}
    rows |= {"sensitivity": [], "blunders": [], "differences": [], "scale": []}
    rows["consistency"] += pixel_rows(bank, data, acquired, models)
    for count in counts:
        report(f"{bank.scene.path.stem}: evaluating {configurations} configurations of {count} cameras")
        verdict = verdict_of(bank, data, acquired, contenders, count, configurations, seed, filtered=count == HEADLINE)
        rows["leaderboard"] += leaderboard(verdict, requested_pairs(contenders))
        rows["ceiling"] += oracle_rows(bank, data, verdict)
        rows["blunders"].append(blunder_row(verdict))
        filtered = None
        if count == HEADLINE:
            filtered = filter_all(data, verdict.configurations, verdict.measured, levels)
            rows["process"] = process_rows(verdict, [contender.name for contender in contenders], levels, filtered)
        rows["consistency"] += consistency_rows(verdict, bank, data, contenders, acquired, filtered)
        if count == HEADLINE:
            visible = visibilities(bank.scene, calibration)
            used, ramp = np.unique(verdict.configurations), detection_model_of(bank.scene, calibration)
            rows["detection"] += detection_rows(bank, data, used, visible, ramp, acquired)
            if ramp is not None:
                rows["reliability"] = reliability_rows(bank, data, used, ramp, acquired)
            rows["sensitivity"] += sensitivity_rows(bank, data, verdict, visible["points"], acquired)
            names = [contender.name for contender in contenders]
            rows["size"] = size_rows(verdict, names)
            rows["differences"] += difference_rows(verdict, names, [base for base in BASES if base in names])
            of_open_unit = [model for model in models if model.name in calibration.scales] + own_models(bank.scene)
            rows["scale"] += scale_rows(bank, verdict, of_open_unit, calibration.scales, acquired)
            rows["parts"] += parts_rows(bank, data, verdict, models, visible, acquired)
    # The pixel level has fewer columns; every row of a file has all of them.
    columns = list(dict.fromkeys(key for row in rows["consistency"] for key in row))
    rows["consistency"] = [{key: row.get(key, float("nan")) for key in columns} for row in rows["consistency"]]
    return rows
