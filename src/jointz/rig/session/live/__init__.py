"""A running session as others see it: Lab Streaming Layer, the operator's view."""
