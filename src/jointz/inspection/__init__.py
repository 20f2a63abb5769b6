"""Inspection of a file, and a proposed study (``jointz inspect``)."""
