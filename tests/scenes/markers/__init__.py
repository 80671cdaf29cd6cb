"""Tests of scenes/markers/."""
