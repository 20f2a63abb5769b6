"""Check of a set-up by a known addition to the joint: ``jointz verify``."""
