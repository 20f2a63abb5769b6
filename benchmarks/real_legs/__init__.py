"""Accuracy of walking estimates in recorded studies of simulated real legs, and in presets."""
