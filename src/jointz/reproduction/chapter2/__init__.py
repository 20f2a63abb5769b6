"""Chapter 2: the series elastic actuator on a bench."""
