"""Array functions without labels: numpy, scipy and numba only."""
