"""Physical simulations whose truth is known."""
