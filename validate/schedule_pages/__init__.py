"""The report of a schedule."""
