"""How well the paper's PSS (σ∞) ranks configurations at each level of process noise, beside a count of what is seen.

The measured filter is a linearised simulation driven by rendered residuals (`validate.points.static_filter`).
Predictions at other process noise need the same information of the same visible points: nothing is looked up again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pss.hints import Floats, Row
from pss.metrics import CAMERAS_TO_OBSERVE
from pss.processes.process import ProcessModel
from pss.processes.steady_state import of_state
from pss.riccati.axes import axis_blocks, position_variance
from pss.riccati.solve import posterior_covariance, steady_state_covariance_from_information
from render.random_streams import random_stream
from validate.acquire.acquire import Acquired
from validate.bank.design import ViewBank, draw_configurations
from validate.bank.filtered import Filtered
from validate.bank.judge import appearance_of, predictions
from validate.bank.leaderboard import CountVerdict
from validate.bank.predicted import Predicted
from validate.prediction.contenders import Contender
from validate.prediction.process_levels import Level, levels_about
from validate.stats.ranking import Ranked, with_interval

__all__ = ["filter_terms", "information_of", "process_levels", "process_rows", "steady_covariances"]


# Configurations of training views that the rule of the headline looks at.
TRAINING_CONFIGURATIONS = 200
# Whose prediction the rule takes: it is fitted to nothing.
RULED_BY = "physical"
# Whose visibility is the paper's points.
POINTS_OF = "physical"
COUNTS = ("visibility-count", "visible-share")


def process_levels(training: ViewBank, acquired: Acquired, cameras: int, seed: int) -> list[Level]:
    """The levels about the median error that the physical R predicts for training configurations of so many cameras.

    Raises:
        RangeError: no point of any of them is observable.
    """
    rng = random_stream(seed, training.scene.path.name, f"training configurations of {cameras}")
    names = [camera.name for camera in training.cameras]
    chosen = draw_configurations(names, min(cameras, len(set(names))), TRAINING_CONFIGURATIONS, rng)
    contender = Contender(RULED_BY, training.scene.noise_model(RULED_BY))
    found = predictions(training, (contender,), chosen, appearance_of(training.scene, acquired))
    information, observable = information_of([of_all[RULED_BY] for of_all in found])
    smallest = np.linalg.eigvalsh(information[observable > 0])[:, 0]
    sigma_m = float(np.median(1 / np.sqrt(smallest))) if smallest.size else float("nan")
    return levels_about(sigma_m)


def information_of(predicted: Sequence[Predicted]) -> tuple[Floats, Floats]:
    """1/m², (K, N, 3, 3), of a frame that finds the point, and the probability of that, (K, N)."""
    return np.array([found.information for found in predicted]), np.array([found.found for found in predicted])


def filter_terms(information: Floats, found: Floats, process: ProcessModel) -> Floats:
    """1/m, terms of the paper's PSS: probability of being found (K, N) over σ∞ of the information (K, N, 3, 3) if so.

    σ∞ belongs to the smallest eigenvalue of the information, as all axes move alike.
    """
    blocks = axis_blocks(process.A, process.Q, np.zeros((process.states, process.states)))
    assert blocks is not None  # of all levels
    terms = np.zeros(found.shape)
    seen = found > 0
    smallest = np.linalg.eigvalsh(information[seen])[:, 0]
    terms[seen] = found[seen] / np.sqrt(position_variance(*blocks, smallest, unsolvable="nan"))
    return np.nan_to_num(terms)


def steady_covariances(information: Floats, found: Floats, process: ProcessModel) -> tuple[Floats, Floats]:
    """m², position blocks of P⁻ and P⁺, (K, N, 3, 3) each; nan where nothing is found or Eq. 4 has no solution."""
    filled = np.full((2, *information.shape), np.nan)
    seen = found > 0
    whole = of_state(information[seen], process.states)
    prior = steady_state_covariance_from_information(process.A, process.Q, whole, unsolvable="nan")
    solved = np.isfinite(prior).all(axis=(-2, -1))
    posterior = np.full_like(prior, np.nan)
    posterior[solved] = posterior_covariance(prior[solved], whole[solved])
    filled[:, seen] = prior[:, :3, :3], posterior[:, :3, :3]
    return filled[0], filled[1]


def process_rows(verdict: CountVerdict, names: Sequence[str], levels: Sequence[Level], filtered: Filtered) -> list[Row]:
    """Rows of process.csv: each level × each contender in `names` × PSS, and the counts of what is seen beside it.

    The counts are of the contender's own visibility; `minus_points_count` is the difference to that of the paper's
    points. `q_over_c` is that of the rule, `q_over_c_measured` has the median of the measured single-frame σ in it.
    """
    chance = verdict.chance
    of_models = {name: information_of([found[name] for found in verdict.predicted]) for name in names}
    counted = {(name, metric): Ranked.of(_count(verdict, name, metric), chance) for name in names for metric in COUNTS}
    c_measured = np.nanmedian([found.errors.sigma_m for found in verdict.measured]) ** 2
    rows: list[Row] = []
    for level, terms in zip(levels, filtered.inverse_sigma, strict=True):
        measured = Ranked.of(terms, chance)
        by_count = {key: ranked.against(measured) for key, ranked in counted.items()}
        for name, (information, found) in of_models.items():
            pss = Ranked.of(filter_terms(information, found, level.process), chance).against(measured)
            for metric, judged in {"pss": pss, **{metric: by_count[name, metric] for metric in COUNTS}}.items():
                rows.append(
                    {
                        **level.row,
                        "q_over_c_measured": level.variance_m2 / c_measured,
                        "cameras": verdict.cameras,
                        "noise_model": name,
                        "metric": metric,
                        "n": len(terms),
                        **with_interval("spearman", judged),
                        **with_interval("minus_visibility_count", judged.minus(by_count[name, "visibility-count"])),
                        **with_interval("minus_visible_share", judged.minus(by_count[name, "visible-share"])),
                        **with_interval("minus_points_count", judged.minus(by_count[POINTS_OF, "visibility-count"])),
                    }
                )
    return rows


def _count(verdict: CountVerdict, name: str, metric: str) -> Floats:
    """A metric of `COUNTS` under a contender's own visibility, (K, N), also where it was not requested."""
    if metric in verdict.predicted[0][name].terms:
        return verdict.terms(name, metric)
    seen = np.array([found[name].visible.sum(axis=0) for found in verdict.predicted])
    return np.minimum(seen, 3) / 3 if metric == "visibility-count" else (seen >= CAMERAS_TO_OBSERVE).astype(float)
