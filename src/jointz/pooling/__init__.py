"""Results of several studies in one table, and means over studies."""
