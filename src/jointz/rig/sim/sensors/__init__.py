"""Models of the sensors of a simulated person."""
