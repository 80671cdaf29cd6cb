"""Which camera sees which point, which whole targets are legible, and how probably one is detected."""
