"""One time series of a joint: impedance, frequency and impulse responses, reflex."""
