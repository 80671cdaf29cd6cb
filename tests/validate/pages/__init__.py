"""Tests of validate/pages/."""
