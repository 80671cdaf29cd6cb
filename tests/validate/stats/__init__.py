"""Tests of validate/stats/."""
