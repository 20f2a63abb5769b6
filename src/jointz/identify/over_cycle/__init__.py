"""Impedance as a curve over the gait cycle."""
