"""The pixel noise table: how well an ArUco marker's centre is localised, against blur, size, incidence and signal."""
