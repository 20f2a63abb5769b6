"""Results of single time series."""
