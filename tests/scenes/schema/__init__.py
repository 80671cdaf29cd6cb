"""Tests of scenes/schema/."""
