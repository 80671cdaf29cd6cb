"""Rules of a scene file that involve several keys."""
