"""Conversion between formats of recordings (``jointz convert``)."""
