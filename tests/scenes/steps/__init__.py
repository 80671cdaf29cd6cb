"""Tests of scenes/steps/."""
