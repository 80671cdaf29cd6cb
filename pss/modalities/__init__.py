"""Other sensors than cameras: each adds its information about a point (Eq. 3)."""
