"""Responses out of recordings, and impedance out of responses."""
