"""Tests of validate/markers/."""
