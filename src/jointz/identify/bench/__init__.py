"""Known loads on a bench: whole trials, single pulses, stiffness tests."""
