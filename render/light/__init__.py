"""The light in a scene: radiosity, the lit surfaces, and the exposure they require."""
