"""Checks of the entries of a collection."""
