"""Interface of devices, and drivers of real ones."""
