"""Figures for files, drawn with matplotlib."""
