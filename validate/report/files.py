"""The name of a run's report in its folder."""

from __future__ import annotations

__all__ = ["REPORT"]

REPORT = "report.html"
