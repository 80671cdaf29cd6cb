"""Tests of validate/commands/."""
