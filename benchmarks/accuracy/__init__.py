"""How accurate every method is on simulated people whose truth is known.

``python -m benchmarks.accuracy --help`` from the root of the repository.
"""
