"""Tests of scenes/people/."""
