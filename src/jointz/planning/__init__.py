"""Plans of perturbation experiments (``jointz plan``): what pulses, sensors and people decide."""
