"""Tests of render/world/."""
