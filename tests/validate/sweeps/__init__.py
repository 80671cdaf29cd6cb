"""Tests of validate/sweeps/."""
