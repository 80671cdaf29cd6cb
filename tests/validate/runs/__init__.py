"""Tests of validate/runs/."""
