"""From the lit scene to radiance on the sensor: thin lens, its defects, motion, and sampling by need."""
