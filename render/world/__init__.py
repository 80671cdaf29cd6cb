"""What is rendered, without a camera: surfaces, meshes, markers, and backdrops from files."""
