"""Tests of pss/visibility/."""
