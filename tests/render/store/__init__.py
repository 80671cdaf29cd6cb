"""Tests of render/store/."""
