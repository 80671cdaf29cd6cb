"""Placement of markers on objects, meshes and people, and checks of the space for their plates."""
