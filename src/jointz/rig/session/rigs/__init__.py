"""Rigs: the devices of an experiment, simulated or real."""
