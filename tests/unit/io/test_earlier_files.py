"""Files that earlier versions of jointz wrote, in `earlier`: their numbers, units and events."""

from pathlib import Path

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Event, Signal
from jointz.io.formats.registry import read_acquisition

EARLIER = Path(__file__).parent / "earlier"


def earlier(suffix: str) -> Acquisition:
    return read_acquisition(EARLIER / f"earlier{suffix}")


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


def test_xlsx() -> None:
    pytest.importorskip("openpyxl", reason="workbooks need jointz[formats]")
    content = earlier(".xlsx")
    found = signals(content)
    table = {name: s.values.tolist() for name, s in found.items() if not s.is_text}
    np.testing.assert_equal(
        table,
        {
            "points/knee": [0.1, np.nan, 0.3],
            "odd/load": [np.nan, 1 / 3, np.nan],
            "odd/step": [1.0, 2.0, 3.0],
            "odd/free": [7.0, 8.0, np.nan],
            "data_/x": [1.0, 2.0, 3.0],
        },
    )
    assert found["points/phase"].values.tolist() == ["a", "", "c"]
    units = {name: s.unit for name, s in found.items() if s.unit}
    assert units == {"points/knee": "deg", "odd/load": "counts", "odd/step": "ticks"}
    np.testing.assert_array_equal(content.groups[0].times_s(), [0.0, 0.01, 0.02])
    assert list(content.metadata) == ["reading.jointz"]


@pytest.mark.parametrize("line", ["[1]", "{", '{"signals": [["a", "N"]]}'])
def test_units_of_a_sto_that_was_edited_are_not_made_up(tmp_path: Path, line: str) -> None:
    text = (EARLIER / "earlier.sto").read_text()
    edited = [f"jointz={line}" if row.startswith("jointz=") else row for row in text.split("\n")]
    (tmp_path / "a.sto").write_text("\n".join(edited))
    (group,) = read_acquisition(tmp_path / "a.sto").groups
    assert [s.unit for s in group.signals] == ["", ""]


def test_sto() -> None:
    content = earlier(".sto")
    found = signals(content)
    np.testing.assert_array_equal(found["/knee_angle_r"].values, [0.5, 1 / 3, np.nan])
    np.testing.assert_array_equal(found["/Fx_left"].values, [1.0, 2.0, 3.0])
    assert [s.unit for s in found.values()] == ["deg", "N"]
    np.testing.assert_array_equal(content.groups[0].times_s(), [0.0, 0.01, 0.02])
    assert "reading.jointz" in content.metadata


def test_mat() -> None:
    content = earlier(".mat")
    points, data = content.groups
    assert (points.name, points.rate_hz, points.start_s) == ("points", 100.0, 2.0)
    angle, phase = points.signals
    assert (angle.name, angle.unit, angle.description) == ("knee angle [deg]", "deg", "left knee")
    np.testing.assert_array_equal(angle.values, [1.5, np.nan, 3.25])
    assert phase.values.tolist() == ["stance", "", "swing"]
    assert (data.name, data.times_s()) == ("", None)
    np.testing.assert_array_equal(data.signals[0].values, [1.0, 2.0])
    assert content.events == (Event(2.01, "heel strike"), Event(2.02, "pulse", 0.1))
    assert content.metadata == {"subject.name": "S01", "positive": "flexion"}


def test_mat_of_a_study() -> None:
    content = read_acquisition(EARLIER / "study.mat")
    found = signals(content)
    np.testing.assert_array_equal(found["S01_perturbed/angle"].values, np.arange(300) % 7)
    assert found["S01_perturbed/torque"].unit == "N*m"
    np.testing.assert_array_equal(content.groups[0].time_s, np.arange(300) / 100)
    np.testing.assert_array_equal(found["S01_perturbed.pulses/onset_s"].values, [1.0, 2.0])
    np.testing.assert_array_equal(found["S01_perturbed.pulses/amplitude"].values, [5.0, -5.0])
    assert content.metadata["joint"] == "knee"


def test_parquet() -> None:
    pytest.importorskip("pyarrow", reason="parquet files need jointz[parquet]")
    content = earlier(".parquet")
    (group,) = content.groups
    assert (group.rate_hz, group.start_s, group.time_column) == (100.0, 0.0, "time [s]")
    assert [(s.name, s.unit) for s in group.signals] == [*((n, "N") for n in "abc"), ("phase", "")]
    np.testing.assert_array_equal(group.signals[2].values, 3.0 * np.arange(40))
    assert group.signals[3].values[:2].tolist() == ["stance", "swing"]
    assert (content.events, content.metadata) == ((Event(0.1, "HS"),), {"subject": "S01"})
