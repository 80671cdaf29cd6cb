"""How points move between frames (Eq. 2), and the steady state that a process has under given information."""
