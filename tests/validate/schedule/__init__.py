"""Tests of validate/schedule/."""
