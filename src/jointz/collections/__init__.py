"""Collections of results of many studies: entries, catalog, pooling (``jointz collect``)."""
