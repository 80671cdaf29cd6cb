"""Rules of a scene file that take several keys at once."""
