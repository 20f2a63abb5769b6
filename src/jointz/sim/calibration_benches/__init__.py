"""Simulated calibration experiments."""
