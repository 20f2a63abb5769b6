"""Results of statistics."""
