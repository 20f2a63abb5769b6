"""Array functions for time series and their spectra."""
