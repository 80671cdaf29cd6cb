"""Tests of validate/plots/."""
