"""Reproduction of the dissertation's chapters (``python -m reproduction``)."""
