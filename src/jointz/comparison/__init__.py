"""Comparison of results, and of results with the literature (``jointz compare``)."""
