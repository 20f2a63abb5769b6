"""Rows of people of the preset ``realistic``: pulses, sensors, and what is estimated from them."""
