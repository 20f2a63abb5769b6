"""Array functions for statistics."""
