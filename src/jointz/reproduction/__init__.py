"""Reproduction of the dissertation's chapters (``jointz reproduce``)."""
