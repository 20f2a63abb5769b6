"""Hypothesis strategies shared by the tests."""

import numpy as np
from hypothesis import strategies as st

SAMPLES = st.floats(allow_nan=True, allow_infinity=True, width=64)


@st.composite
def tables(draw: st.DrawFn) -> dict[str, np.ndarray]:
    """Return columns of equal length, 1 to 4 of them, 2 to 20 samples."""
    names = draw(st.lists(st.sampled_from("abcdef"), min_size=1, max_size=4, unique=True))
    n = draw(st.integers(2, 20))
    column = st.lists(SAMPLES, min_size=n, max_size=n).map(np.array)
    return {name: draw(column) for name in names}


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """Return the content after 1 to 4 random truncations, flips and insertions."""
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)))
        kind = draw(st.sampled_from(["truncate", "flip", "insert"]))
        if kind == "truncate":
            content = content[:at]
        elif kind == "flip":
            content = content[:at] + bytes([draw(st.integers(0, 255))]) + content[at + 1 :]
        else:
            piece = draw(st.sampled_from([b"\n", b"\r", b",", b'"', b"\x00", b";", b" "]))
            content = content[:at] + piece + content[at:]
    return content
