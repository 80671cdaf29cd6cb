"""Tests of pss/cameras/."""
