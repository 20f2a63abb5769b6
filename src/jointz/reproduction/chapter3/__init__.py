"""Chapter 3: the torque model of the motor."""
