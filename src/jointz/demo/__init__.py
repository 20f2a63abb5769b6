"""The demonstration on simulated people (``jointz demo``)."""
