"""Runs set side by side: `run_sweep.py compare`."""
