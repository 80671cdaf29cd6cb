"""Tests of validate/prediction/."""
