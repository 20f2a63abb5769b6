"""Estimates during a session, by a process beside the control loop."""
