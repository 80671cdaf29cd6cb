"""The metric itself: from cameras and points to σ∞ (section 3.2), to one number (3.3), and the table of metrics."""
