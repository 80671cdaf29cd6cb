"""Tests of validate/acquire/."""
