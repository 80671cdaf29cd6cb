"""Tests of pss/."""
