"""Calibration of the instruments: one step a module, arrays in, entries with sd out."""
