"""Walking people: body, gait and pose."""
