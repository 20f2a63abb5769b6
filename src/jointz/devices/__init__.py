"""What a device is, and drivers of real ones."""
