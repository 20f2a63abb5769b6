"""The method for legs to which a device is strapped: every timing point in one Bayesian fit."""
