"""The recommended estimator of walking: prediction, joint and sensor, checks."""
