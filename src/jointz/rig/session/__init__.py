"""Experiments: running a protocol on devices or their simulation (``jointz run``)."""
