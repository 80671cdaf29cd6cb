"""From the lit scene to radiance on the sensor: thin lens, lens effects, motion, and adaptive sampling."""
