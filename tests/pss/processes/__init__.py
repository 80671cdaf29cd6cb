"""Tests of pss/processes/."""
