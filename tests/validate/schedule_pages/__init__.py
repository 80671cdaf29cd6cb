"""Tests of validate/schedule_pages/."""
