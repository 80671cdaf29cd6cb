"""The report of a run: one HTML file that shows what was predicted, what was measured, and what the cameras saw."""
