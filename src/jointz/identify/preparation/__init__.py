"""Recordings made ready: signals, pulses, what is subtracted, what is known of the instruments."""
