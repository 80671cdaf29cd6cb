"""Tests of render/files/."""
