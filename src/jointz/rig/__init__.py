"""Everything that touches a device, a simulation or a run."""
