"""Files that earlier versions of jointz wrote, in `earlier`: their numbers, units and events."""

from pathlib import Path

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Event, Signal
from jointz.io.formats.registry import read_acquisition


def earlier(suffix: str) -> Acquisition:
    return read_acquisition(Path(__file__).parent / "earlier" / f"earlier{suffix}")


def signals(content: Acquisition) -> dict[str, Signal]:
    return {f"{g.name}/{s.name}": s for g in content.groups for s in g.signals}


def test_c3d() -> None:
    content = earlier(".c3d")
    found = signals(content)
    np.testing.assert_array_equal(found["points/LKNE.y"].values, 1 + np.arange(4) / 4)
    np.testing.assert_array_equal(found["analogs/torque"].values, np.arange(8) / 8)
    assert (found["points/LKNE.y"].unit, found["analogs/torque"].unit) == ("mm", "Nm")
    assert [(g.rate_hz, g.start_s) for g in content.groups] == [(100.0, 0.5), (200.0, 0.5)]
    assert content.events == (Event(0.5, "go"), Event(61.5, "Left Foot Strike"))


def test_xdf() -> None:
    pytest.importorskip("pyxdf", reason="XDF files need jointz[formats]")
    content = earlier(".xdf")
    found = signals(content)
    np.testing.assert_array_equal(found["wheel/speed"].values, np.arange(4) / 3)
    np.testing.assert_array_equal(found["signals/force"].values, np.arange(3.0))
    assert (found["wheel/speed"].unit, found["signals/force"].unit) == ("rad/s", "N")
    assert [(g.rate_hz, g.start_s) for g in content.groups][:1] == [(100.0, 2.5)]
    assert content.events == (Event(2.5, "go"), Event(2.51, "step", 0.25), Event(2.52, "stop"))
