"""What every study of the bank begins with: views rendered and measured, and the calibration on the training ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pss.noise import Calibration
from render.store.folder import write_text
from validate.acquire.messages import RunMessages
from validate.acquire.request import Acquired
from validate.acquire.source import ViewSource
from validate.acquire.view_names import view_names
from validate.bank.design import BankDesign, ViewBank
from validate.bank.judge import calibrated, data_of, detection_of, limits_of, scales_of

__all__ = ["acquire_banks", "calibrate", "enough"]


def acquire_banks(banks: Sequence[ViewBank], source: ViewSource) -> tuple[Acquired, list[ViewBank]]:
    """All renders of the banks; and the banks without views that failed, which are named."""
    requested = [item for bank in banks for item in bank.requested]
    messages = source.messages
    acquired = source.acquire(requested)
    messages.failed(acquired.failed, view_names(requested))
    whole = [bank.without(acquired.failed) for bank in banks]
    for bank, kept in zip(banks, whole, strict=True):
        if lost := len(bank.views) - len(kept.views):
            messages.left_out(
                f"{bank.scene.path.stem}, {bank.role}: {lost} of {len(bank.views)} views left out, as a render of each "
                "failed; the others are evaluated without them"
            )
    return acquired, whole


def enough(training: ViewBank, judged: ViewBank, cameras: int, messages: RunMessages) -> bool:
    """Whether there are views to calibrate on, and of so many cameras to evaluate; prints a line if not."""
    names = {camera.name for camera in judged.cameras}
    if training.views and len(names) >= cameras:
        return True
    messages.left_out(
        f"no tables of {judged.scene.path.stem}: {len(training.views)} training views and {len(names)} cameras are "
        f"left, needed: 1 and {cameras}; all other views are in the store, and another run takes the failed ones only"
    )
    return False


def calibrate(
    training: ViewBank, acquired: Acquired, design: BankDesign, out: Path, detection: ViewBank | None = None
) -> Calibration:
    """Noise weights, limits of detection and scales by the training views, left as `calibrated.toml`.

    With the bank of `detection_views` the probability of detection too, by these and the training views. They enter
    nothing else.
    """
    data = data_of(training, acquired, design.seed)
    fitted, limits = calibrated(training, data, acquired), limits_of(training, data, acquired)
    scales = scales_of(training, data, acquired, fitted)
    ramp = None if detection is None else detection_of((training, detection), acquired, design.seed)
    provenance: dict[str, str | int | float] = {
        "scene": training.scene.path.name,
        "views": len(training.views),
        "renders_of_each": design.turns,
        "trials_of_each": design.trials,
        "seed": design.seed,
        "moments": fitted.moments,
        "left_out_as_blunders": fitted.left_out,
        "deviance_per_moment": fitted.deviance / fitted.moments,
        **limits.provenance,
        **({} if ramp is None else ramp.provenance),
        "fitted_by": "python validate/run_sweep.py bank",
    }
    coefficients = {} if ramp is None else ramp.coefficients
    calibration = Calibration("calibrated", fitted.weights, provenance, limits.limits, scales, coefficients)
    write_text(out / "calibrated.toml", calibration.to_toml())
    return calibration
