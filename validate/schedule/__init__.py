"""Cameras that follow two people: strategies, steering, and what held steps of the walk predict and measure."""
