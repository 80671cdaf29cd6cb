"""Predictions at the points of surrogates that stand where the people do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pss import Appearance, PTZCamera, evaluate_many
from validate.prediction.contenders import Contender
from validate.schedule.design import Design
from validate.schedule.stage import BOTH
from validate.schedule.surrogates import avatar_like
from validate.sweeps.rows import pooled

__all__ = ["SurrogatePrediction", "predicted_at_surrogates"]


@dataclass(frozen=True)
class SurrogatePrediction:
    """PSS at a surrogate's points, 1/m, and σ∞, m, root mean square of those that are observable (nan: none)."""

    pss: float
    sigma_inf_rms_m: float


def predicted_at_surrogates(
    design: Design,
    step: int,
    cameras: Sequence[tuple[PTZCamera, ...]],
    contenders: Sequence[Contender],
    marker_appearance: Appearance,
) -> list[dict[str, dict[str, SurrogatePrediction]]]:
    """The prediction of each configuration at the surrogates' points, by avatar (and for both) and noise model.

    The surrogates stand where the people do. A surrogate has no markers: for a noise model that needs how a target
    looks, each of its points bears one like the median marker of the scene.
    """
    scene, walk = design.scenes[step], design.stage.walk
    points, normals, bodies, owner = [], [], [], []
    for each in walk.walks:
        middle = walk.positions_m[each.name][step]
        person = avatar_like(design.schedule.spec.surrogate, scene.state, each.name, middle)
        points.append(person.surrogate.points_m + middle)
        normals.append(person.surrogate.normals)
        bodies.append(person.body(each.name, middle))
        owner += [each.name] * len(person.surrogate.points_m)
    where, outwards = np.concatenate(points), np.concatenate(normals)
    typical = _typical(marker_appearance)
    groups = {name: np.array(owner) == name for name in design.stage.names}
    groups[BOTH] = np.ones(len(where), dtype=bool)
    found: list[dict[str, dict[str, SurrogatePrediction]]] = [{name: {} for name in groups} for _ in cameras]
    for contender in contenders:
        evaluations = evaluate_many(
            cameras,
            where,
            outwards,
            noise=contender.noise,
            process=scene.process,
            occluder=bodies,
            appearance=typical,
            visibility=contender.visibility,
            detection=contender.detection,
        )
        for of_all, evaluation in zip(found, evaluations, strict=True):
            for name, members in groups.items():
                sigma = evaluation.sigma_m[members]
                of_all[name][contender.name] = SurrogatePrediction(
                    float(np.nansum(evaluation.found[members] / sigma) / len(sigma)), pooled(sigma, members[members])
                )
    return found


def _typical(marker_appearance: Appearance) -> Appearance:
    """The median marker."""
    of_all = (marker_appearance.module_m, marker_appearance.white_w_per_m2_sr, marker_appearance.black_w_per_m2_sr)
    return Appearance(
        *(float(np.median(values)) for values in of_all), None, marker_appearance.modules, marker_appearance.ring_light
    )
