"""Tests of render/lens/."""
