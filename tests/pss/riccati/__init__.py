"""Tests of pss/riccati/."""
