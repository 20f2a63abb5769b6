"""The explorer of results (``jointz explore``)."""
