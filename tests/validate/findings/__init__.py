"""Tests of validate/findings/."""
