"""Tests of pss/noise/."""
