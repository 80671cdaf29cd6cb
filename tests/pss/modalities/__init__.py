"""Tests of pss/modalities/."""
