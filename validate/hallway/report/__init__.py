"""The report of a schedule: the page of sweeps, with a choice of strategy and zoom limit, played along the walk."""
