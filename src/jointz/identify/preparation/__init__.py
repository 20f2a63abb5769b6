"""Preparation of recordings: signals, pulses, baselines, calibration."""
