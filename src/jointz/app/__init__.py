"""Pages in a browser: the operator's console and the explorer of results (``jointz[app]``)."""
