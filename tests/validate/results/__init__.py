"""Tests of validate/results/."""
