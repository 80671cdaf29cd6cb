"""Findings: sentences with numbers and intervals, made from the tables of runs."""
