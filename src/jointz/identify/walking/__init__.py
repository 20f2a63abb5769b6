"""The method of walking: every timing point of a person in one Bayesian fit."""
