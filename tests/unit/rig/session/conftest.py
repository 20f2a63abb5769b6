"""Fixtures of the tests of sessions."""

from .laboratory import laboratory

__all__ = ["laboratory"]
