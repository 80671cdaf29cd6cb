"""What every study of the bank begins with: views rendered and measured, and the calibration on the training ones."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from pss.noise import Calibration
from render.backend import Backend
from validate.acquire import Acquired, acquire
from validate.bank.design import BankDesign, ViewBank
from validate.bank.study import calibrated, data_of, limits_of
from validate.progress import ViewProgress
from validate.remote_store import open_store
from validate.scale.options import HERE, Scale
from validate.store import write_text

__all__ = ["acquire_banks", "calibrate"]


def acquire_banks(
    banks: list[ViewBank], store: str | Path, chosen: Backend, errors: Console, scale: Scale = HERE
) -> Acquired | None:
    """All renders of the banks, made where `scale` says and measured; None if one failed, which is said."""
    wanted = [item for bank in banks for item in bank.wanted]
    acquired = acquire(wanted, open_store(store), chosen, lambda total: ViewProgress(total, errors), scale)
    for key, cause in acquired.failed.items():
        errors.print(f"view {key} failed: {cause}", markup=False, style="red")
    return None if acquired.failed else acquired


def calibrate(training: ViewBank, acquired: Acquired, design: BankDesign, out: Path) -> Calibration:
    """Noise weights and limits of detection by the training views, left as `calibrated.toml`."""
    data = data_of(training, acquired, design.seed)
    fitted, limits = calibrated(training, data, acquired), limits_of(training, data, acquired)
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
        "fitted_by": "python validate/run_sweep.py bank",
    }
    calibration = Calibration("calibrated", fitted.weights, provenance, limits.limits)
    write_text(out / "calibrated.toml", calibration.to_toml())
    return calibration
