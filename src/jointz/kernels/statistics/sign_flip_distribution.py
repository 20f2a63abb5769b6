"""Sign flips of paired differences: the exact distribution of the largest t over nodes."""

import numpy as np

#: Numbers of flips times nodes that are held at once.
_BLOCK = 1 << 21
#: Relative difference below which two statistics are a tie: rounding of a sum, not data.
_TIE = 1e-10
#: Keeps t finite where flipped differences are all the same.
_LARGEST_SQUARE = 1.0 - 4.0 * float(np.finfo(float).eps)


def all_signs(n: int) -> np.ndarray:
    """Return every way to flip n signs, those of one another's negatives once.

    Returns (2**(n-1), n): rows of 1 and -1, the first sign always 1, the first row all 1. Two-sided
    statistics are the same for a row and its negative.
    """
    if n < 1:
        raise ValueError(f"all_signs: expected at least 1 difference, got {n}")
    bits = (np.arange(1 << (n - 1))[:, np.newaxis] >> np.arange(n - 1)) & 1
    return np.hstack([np.ones((bits.shape[0], 1)), 1.0 - 2.0 * bits])


def drawn_signs(n: int, n_flips: int, rng: np.random.Generator) -> np.ndarray:
    """Return random flips of n signs, the first row as observed.

    Returns (n_flips, n): rows of 1 and -1. The observed signs count as one draw, which keeps the
    test valid however few are drawn (Phipson and Smyth 2010, doi:10.2202/1544-6115.1585).
    """
    if n < 1 or n_flips < 1:
        raise ValueError(f"drawn_signs: expected at least 1 each, got n {n}, n_flips {n_flips}")
    signs = 1.0 - 2.0 * rng.integers(0, 2, size=(n_flips, n))
    signs[0] = 1.0
    return signs


def cosines(differences: np.ndarray) -> np.ndarray:
    """Return differences whose sums over people are cosines with a constant.

    ``differences`` (n, n_node): not zero in everybody at a node. Returns (n, n_node): scaled by
    node, so that ``signs @ cosines`` is between -1 and 1 and grows with t; flips leave the scale as
    it is.
    """
    size = np.sqrt(differences.shape[0] * np.einsum("ij,ij->j", differences, differences))
    return np.asarray(differences / size)


def largest_cosines(scaled: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Return the largest absolute cosine over nodes of each flip.

    ``scaled`` (n, n_node): of :func:`cosines`; ``signs`` (n_flips, n). Returns (n_flips,).
    """
    rows = max(1, _BLOCK // scaled.shape[1])
    largest = np.empty(signs.shape[0])
    for start in range(0, signs.shape[0], rows):
        product = signs[start : start + rows] @ scaled
        largest[start : start + rows] = np.maximum(product.max(axis=1), -product.min(axis=1))
    return largest


def critical_cosine(largest: np.ndarray, alpha: float) -> float:
    """Return the cosine that more than a share alpha of flips does not go beyond.

    ``largest`` (n_flips,): of :func:`largest_cosines`, the observed flip among them. Observed
    cosines beyond it, never those equal to it, are rejected: at most a share alpha of flips are
    (Nichols and Holmes 2002, doi:10.1002/hbm.1058).
    """
    # A hair above alpha * n, lest 0.05 * 20 be less than 1.
    allowed = int(alpha * largest.size * (1.0 + _TIE))
    return float(np.sort(largest)[largest.size - 1 - allowed]) * (1.0 + _TIE)


def flip_p_values(observed: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """Return p-values adjusted for all nodes.

    ``observed`` (n_node,) cosines; ``largest`` (n_flips,). Returns (n_node,): share of flips whose
    largest is at least as large.
    """
    below = np.searchsorted(np.sort(largest) * (1.0 + _TIE), np.abs(observed), side="left")
    return np.asarray((largest.size - below) / largest.size)


def cosine_to_t(cosine: np.ndarray, n: int) -> np.ndarray:
    """Return Student's t of the cosine of n differences with a constant.

    Returns t with n - 1 degrees of freedom: sqrt(n - 1) times the cotangent; finite at a cosine of
    1.
    """
    square = np.minimum(np.square(cosine), _LARGEST_SQUARE)
    return np.asarray(np.sign(cosine) * np.sqrt((n - 1) * square / (1.0 - square)))
