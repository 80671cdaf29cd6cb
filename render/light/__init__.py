"""The light in a scene: radiosity, the lit surfaces, and the exposure that they ask for."""
