"""Results of benches, actuators and calibrations."""
