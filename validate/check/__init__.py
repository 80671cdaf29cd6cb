"""What the cameras of a scene will see, foreseen without rendering: `run_sweep.py check`."""
