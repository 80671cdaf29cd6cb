"""Tests of validate/comparison/."""
