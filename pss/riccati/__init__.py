"""The steady state of a Kalman filter, and the small matrices that it is made of (Eqs. 4 to 8)."""
