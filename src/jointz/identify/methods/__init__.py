"""The family of estimators that regress pulse by pulse, and the registry of all methods."""
