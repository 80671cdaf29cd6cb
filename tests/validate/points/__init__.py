"""Tests of validate/points/."""
