"""Other sensors beside cameras: each adds its own information about a point (Eq. 3)."""
