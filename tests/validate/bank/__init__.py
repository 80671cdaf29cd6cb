"""Tests of validate/bank/."""
