"""Tests of validate/store/."""
