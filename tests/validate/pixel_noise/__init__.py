"""Tests of validate/pixel_noise/."""
