"""Torque models and bandwidth of actuators."""
