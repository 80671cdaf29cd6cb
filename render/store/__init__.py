"""The store of views, solved light and measurements: files that survive interruption."""
