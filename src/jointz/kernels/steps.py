"""Signals at the steps of an integration between their samples."""

import numpy as np


def at_steps(signal: np.ndarray, substeps: int) -> np.ndarray:
    """Return a signal (n,) at so many steps a sample, linear between samples."""
    steps = np.arange((signal.size - 1) * substeps + 1) / substeps
    return np.asarray(np.interp(steps, np.arange(signal.size), signal))
