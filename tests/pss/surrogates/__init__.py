"""Tests of pss/surrogates/."""
