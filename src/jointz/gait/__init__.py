"""Heel strikes, strides and the phase of a sample."""
