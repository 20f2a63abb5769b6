"""What simulated sensors measure."""
