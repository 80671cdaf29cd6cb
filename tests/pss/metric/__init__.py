"""Tests of pss/metric/."""
