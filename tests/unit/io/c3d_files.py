"""C3D files of another writer, ezc3d."""

from typing import Any

import numpy as np
import pytest


def theirs(
    points: dict[str, np.ndarray], analogs: np.ndarray, labels: list[str], rate_hz: int = 100
) -> Any:
    """Points of three rows by label, and channels at whole times their rate."""
    ezc3d = pytest.importorskip("ezc3d", reason="the other writer is not installed")
    n_frames = next(iter(points.values())).shape[1]
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [rate_hz]
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(points)
    file["parameters"]["ANALOG"]["RATE"]["value"] = [rate_hz * analogs.shape[1] // n_frames]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = labels[:255]
    for number, start in enumerate(range(255, len(labels), 255), start=2):
        file.add_parameter("ANALOG", f"LABELS{number}", labels[start : start + 255])
    seen = np.stack(list(points.values()), axis=1)
    file["data"]["points"] = np.concatenate([seen, np.ones((1, *seen.shape[1:]))])
    file["data"]["analogs"] = analogs[np.newaxis]
    return file
