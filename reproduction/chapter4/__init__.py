"""Chapter 4: impedance of the knee in walking."""
