"""Trials on a bench: plan, streams and reference signals."""
