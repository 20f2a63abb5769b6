"""Calibration of instruments from a calibration study (``jointz calibrate``)."""
