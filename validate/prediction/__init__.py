"""What the metric predicts of a scene, and the calibrations that it predicts with."""
