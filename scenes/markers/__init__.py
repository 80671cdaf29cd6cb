"""Where markers are on objects, meshes and people, and whether their plates have room there."""
