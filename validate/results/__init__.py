"""The result of a run of sweeps as one object: computed from the files, saved as tables, figures and report."""
