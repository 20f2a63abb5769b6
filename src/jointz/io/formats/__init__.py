"""Formats of recordings: the registry and the formats of tables."""
