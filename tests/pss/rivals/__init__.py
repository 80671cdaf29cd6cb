"""Tests of pss/rivals/."""
