"""The rendered world, without a camera: surfaces, meshes, markers, and backdrops from files."""
