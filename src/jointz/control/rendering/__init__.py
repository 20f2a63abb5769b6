"""Rendering of a profile by an actuator: stability, passivity, torque and bandwidth."""
