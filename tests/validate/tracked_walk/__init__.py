"""Tests of validate/tracked_walk/."""
