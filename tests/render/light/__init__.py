"""Tests of render/light/."""
