"""Plans of perturbation experiments (``jointz plan``): pulses, sensors, minutes and people."""
