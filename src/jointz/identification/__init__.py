"""Identification of single recordings (``jointz identify``)."""
