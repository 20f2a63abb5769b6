"""Coverage and power of people together: ``python -m benchmarks.people`` from the root."""
