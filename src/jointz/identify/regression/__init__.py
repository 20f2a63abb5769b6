"""Estimators that fit every cell by itself."""
