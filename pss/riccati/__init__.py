"""The steady state of a Kalman filter (Eqs. 4 to 8), and operations on small matrices."""
