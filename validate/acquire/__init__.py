"""Views acquired: taken from the store, or rendered and measured here or by workers."""
