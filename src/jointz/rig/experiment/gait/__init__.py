"""Gait in real time: heel strikes, phase, steadiness."""
