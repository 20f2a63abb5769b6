"""Simulated benches with known loads."""
