"""How much the ranking depends on what the paper does not fix: constants of Eqs. 11 to 13, each factor alone, the unit.

The unit of R matters to the filter alone: a whole R times s multiplies each single-frame C by s, which changes no rank,
but P∞ weighs R against the process noise.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from pss import NoiseModel, noise_model
from pss.hints import Row
from pss.noise import IdentityNoise
from pss.noise.blur import PIXEL_VARIANCE_PX2
from pss.visibility.points import VisibilityTest
from scenes import Scene
from validate.acquire.acquire import Acquired
from validate.bank.design import ViewBank
from validate.bank.judge import appearance_of, predictions
from validate.bank.leaderboard import CountVerdict, measures, single_frame_terms
from validate.bank.measured import BankData
from validate.prediction.contenders import Contender, own_models
from validate.prediction.weights import scaled
from validate.stats.ranking import judge_against, with_interval

__all__ = ["scale_rows", "sensitivity_rows", "variants"]


# Neither constant has a value in the paper: each is tried a factor of ten up and down, the other as it is.
BAND = (0.1, 1.0, 10.0)
OF_THE_PAPER = ("as-printed", "corrected")
PIXEL = IdentityNoise(PIXEL_VARIANCE_PX2, "pixel")
FACTORS = ("distance", "incidence", "resolution", "defocus")
# Of a whole R: from m² that are read as px² to pixel errors of a thousandth.
SCALES = (1.0, 1e-2, 1e-4, 1e-6)


def variants(scene: Scene, tests: Sequence[VisibilityTest]) -> list[tuple[Row, Contender]]:
    """Contenders with other constants, and with each factor alone, and the columns of their rows.

    The paper's models have two open constants; each factor of the scene's own models has a weight.
    """
    found = []
    dark, noise = scene.sensor.ccd_noise, scene.resolved()["noise"]
    scale = noise["px2_per_m2"]
    for name in OF_THE_PAPER:
        for times in BAND:
            other_unit = scene.noise_model(name, px2_per_m2=scale * times)
            darker = scene.noise_model(name, ccd_noise=dark * times)
            for constant, model in (("px2_per_m2", other_unit), ("ccd_noise", darker)):
                row: Row = {"noise_model": name, "varied": constant, "multiplier": times}
                found.append((row, Contender(f"{name}, {constant} × {times:g}", model, tuple(tests))))
        for kept in FACTORS:
            off = [factor for factor in FACTORS if factor != kept]
            model = noise_model(name, switched_off=off, ccd_noise=dark, px2_per_m2=scale)
            row = {"noise_model": name, "varied": f"{kept} alone", "multiplier": 1.0}
            found.append((row, Contender(f"{name}, {kept} alone", model, tuple(tests))))
    return found + [each for model in own_models(scene) for each in _own_variants(model, tests)]


def _own_variants(model: NoiseModel, tests: Sequence[VisibilityTest]) -> list[tuple[Row, Contender]]:
    """Other weights of each factor, and each factor alone, beside the variance of a pixel's width.

    A factor need not be positive definite by itself: without the pixel a sum of such ones only is no R.
    """
    found = []
    for factor in dict.fromkeys(factor.name for factor in model.factors):
        for times in BAND:
            label = f"{model.name}, {factor} × {times:g}"
            row: Row = {"noise_model": model.name, "varied": f"weight of {factor}", "multiplier": times}
            found.append((row, Contender(label, model.weighted({factor: times}, label), tuple(tests))))
        kept = tuple(each for each in model.factors if each.name == factor)
        alone = NoiseModel(f"{model.name}, {factor} alone", (*kept, PIXEL))
        row = {"noise_model": model.name, "varied": f"{factor} alone", "multiplier": 1.0}
        found.append((row, Contender(alone.name, alone, tuple(tests))))
    return found


def sensitivity_rows(
    bank: ViewBank, data: BankData, verdict: CountVerdict, tests: Sequence[VisibilityTest], acquired: Acquired
) -> list[Row]:
    """A row for each variant: Spearman of its single-frame PSS with the measured one, with a 95 % interval."""
    named = variants(bank.scene, tests)
    contenders = [contender for _, contender in named]
    appearance = appearance_of(bank.scene, acquired)
    found_by_all = predictions(bank, contenders, verdict.configurations, appearance)
    chance = verdict.chance
    measured = np.array([found.errors.inverse_sigma for found in verdict.measured])
    return [
        {
            "cameras": verdict.cameras,
            **row,
            **with_interval(
                "spearman",
                judge_against(
                    np.array([single_frame_terms(of_all[contender.name]) for of_all in found_by_all]), measured, chance
                ),
            ),
        }
        for row, contender in named
    ]


def scale_rows(
    bank: ViewBank, verdict: CountVerdict, models: Sequence[NoiseModel], scales: Mapping[str, float], acquired: Acquired
) -> list[Row]:
    """Spearman of the paper's PSS with that measured by the filter, for each of `models` times `SCALES` and its own.

    Args:
        models: R_k as they are.
        scales: by the name of a model, the scale that fits the training views (a calibration's); not of all models.
    """
    named: list[tuple[Row, Contender]] = []
    for model in models:
        own = [("yes", scales[model.name])] if model.name in scales else []
        for fitted, times in (*(("no", times) for times in SCALES), *own):
            label = f"{model.name} × {times!r}"
            row: Row = {"noise_model": model.name, "multiplier": times, "fitted": fitted}
            named.append((row, Contender(label, scaled(model, times, label), bank.scene.visibility)))
    contenders = [contender for _, contender in named]
    found_by_all = predictions(bank, contenders, verdict.configurations, appearance_of(bank.scene, acquired))
    own = dataclasses.replace(verdict, predicted=found_by_all)
    (measured,) = (y for y in measures(verdict.measured) if y.name == "measured_pss_filter")
    return [
        {
            "cameras": verdict.cameras,
            "metric": "pss",
            "measure": measured.name,
            **row,
            **with_interval(
                "spearman", judge_against(own.terms(contender.name, "pss"), measured.values, verdict.chance)
            ),
        }
        for row, contender in named
    ]
