"""Test bed for controllers of a knee in simulated walking, and their comparison."""
