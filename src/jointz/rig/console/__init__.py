"""The operator's console (``jointz console``)."""
