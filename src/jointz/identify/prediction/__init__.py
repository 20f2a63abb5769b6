"""Prediction of the unperturbed motion, and the responses of pulses relative to it."""
