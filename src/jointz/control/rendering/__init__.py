"""What an actuator can render of a profile: stability, passivity, torque and bandwidth."""
