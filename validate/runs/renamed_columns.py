"""Columns of results that had another name in version 0.1: folders of that version stay readable."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["RENAMED_COLUMNS", "current_names"]

_EXTREMES = {
    f"spearman_{name}_{old}": f"spearman_{name}_{new}"
    for name in ("plain", "with_term", "propagated", "other_draws")
    for old, new in (("least", "min"), ("most", "max"))
}

RENAMED_COLUMNS = {
    "alike_frame_rate_hz": "equivalent_frame_rate_hz",
    "at": "where",
    "believed_median_m": "claimed_median_m",
    "figure": "statistic",
    "for_these_markers_alone": "holds_for_these_markers_only",
    "found_again": "reacquired",
    "least_views": "min_views",
    "losses": "track_losses",
    "minus": "baseline",
    "not_told_apart": "tied_with_optimum",
    "over_told": "density_over_assumed",
    "place": "optimum_position",
    "posterior_believed_rms_m": "posterior_claimed_rms_m",
    "prior_believed_rms_m": "prior_claimed_rms_m",
    "schedules_own": "is_schedule_process",
    "strangers": "unexpected_ids",
    "times": "multiplier",
    "told_m2_s3": "assumed_density_m2_s3",
    "twin_of": "equivalent_to",
    "what": "event",
    "yardstick": "measure",
    **_EXTREMES,
}
"""Old name of a column to its present one; `csv_file.read_csv` and `csv_file.read_head` apply it."""


def current_names(head: Sequence[str]) -> list[str]:
    """The names of columns as written today; an old name stays where its present one stands beside it."""
    return [name if (new := RENAMED_COLUMNS.get(name, name)) in head else new for name in head]
