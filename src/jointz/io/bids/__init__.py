"""Motion-BIDS folders."""
