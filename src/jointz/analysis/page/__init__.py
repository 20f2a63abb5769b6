"""The HTML report of an analysis: its sections, figures and details."""
