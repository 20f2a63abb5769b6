"""Means and differences over people: coverage, and power, of studies drawn from one pool."""
