"""Cameras: the pinhole and the thin lens, what they see, the light on their sensors, and their motors."""
