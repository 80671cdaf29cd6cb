"""Runs side by side: matched rows, differences, figures and the page."""
