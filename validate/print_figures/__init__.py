"""The paper's Figures 1 to 4 from our own runs, in vector form for print: `run_sweep.py figures`."""
