"""Encoder and gyroscopes from a run, or a file of one's own, to the recordings of a study."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError, StudyError
from jointz.io.protocols import load_protocol
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

NAMES = {"joint_encoder", "shank_velocity", "thigh_velocity"}
ALL = ["goniometer", "encoder", "gyroscopes"]


def short_protocol():
    protocol = load_protocol("walking")
    last = protocol.conditions[-1]
    plan = last.perturbations.model_copy(update={"count_per_point": 1})
    last = last.model_copy(update={"perturbations": plan})
    first = protocol.conditions[-2].model_copy(update={"strides": 15})
    return protocol.model_copy(update={"conditions": (first, last)})


def declared(study: Path) -> set[str]:
    return NAMES & set(tomllib.loads((study / "study.toml").read_text())["channels"])


class TestRun:
    def test_log_and_recording_have_the_sensors_though_gyroscopes_have_a_clock_of_their_own(
        self, tmp_path
    ):
        made = jointz.run(
            short_protocol(), out=tmp_path / "study", preset="realistic", participants=1, seed=2
        )
        assert declared(made.study) == NAMES
        for entry in jointz.open_study(made.study).recordings:
            (recording,) = entry.read()
            velocity = recording["shank_velocity"] - recording["thigh_velocity"]
            assert np.isfinite(recording["joint_encoder"]).all()
            # In a record too short to know its rate a clock is off by some 0.1 ms at the ends.
            assert np.isfinite(velocity[2:-2]).all()
            # Lags of up to 5 ms, tissue and strap lie between them.
            error = np.std(velocity - recording["motor_velocity"])
            assert error < 0.1 * np.std(recording["motor_velocity"])
        known = tomllib.loads((made.study / "study.toml").read_text())["participants"][0]
        assert known["calibration"]["shank_velocity_lag_s"]["sd"] == 0.0005
        with pytest.raises(DataError, match="sensors None, now"):
            jointz.run(
                short_protocol(),
                out=made.study,
                preset="realistic",
                participants=1,
                seed=2,
                sensors=ALL,
                resume=True,
            )

    def test_sensors_are_refused_on_a_bench(self, tmp_path):
        with pytest.raises(DataError, match="sensors: they are chosen for simulated people"):
            jointz.run("qdd-static", out=tmp_path / "study", sensors=ALL)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return simulate_study(
        tmp_path_factory.mktemp("sensors") / "study",
        plan=WalkPlan(per_point=1),
        unperturbed_strides=5,
        sensors=ALL,
    )


class TestSimulatedStudy:
    @pytest.mark.parametrize(
        ("preset", "sensors", "expected"),
        [
            ("nominal", None, set()),
            ("realistic", None, NAMES),
            ("realistic", ["goniometer"], set()),
            ("nominal", ["goniometer", "encoder"], {"joint_encoder"}),
        ],
    )
    def test_sensors_are_a_choice(self, tmp_path, preset, sensors, expected):
        made = simulate_study(
            tmp_path / "study",
            preset=preset,
            sensors=sensors,
            plan=WalkPlan(per_point=1),
            unperturbed_strides=5,
        )
        assert declared(made) == expected
        recording = jointz.open_study(made).recordings[1].read()[0]
        assert NAMES & set(recording.data_vars) == expected


class TestOwnFiles:
    def rewritten(self, study, folder, *, toml=lambda text: text, drop=()):
        """Write the study with recordings as text in degrees, some without some columns."""
        text = (study / "study.toml").read_text().replace(".nc", ".csv")
        for entry in jointz.open_study(study).recordings:
            (recording,) = entry.read()
            table = recording.to_dataframe().reset_index()
            table["shank_velocity"] = -np.rad2deg(table["shank_velocity"])
            if entry.spec.condition in drop:
                table = table.drop(columns=["shank_velocity"])
            table.to_csv(folder / f"{Path(entry.spec.file).stem}.csv", index=False)
        text = text.replace(
            'channels.shank_velocity = { column = "shank_velocity", unit = "rad/s" }',
            'channels.shank_velocity = { column = "shank_velocity", unit = "deg/s", '
            'positive = "extension" }',
        )
        for table in study.glob("*.csv"):
            (folder / table.name).write_bytes(table.read_bytes())
        (folder / "study.toml").write_text(toml(text))
        return folder

    def test_unit_and_direction_are_the_channels_own(self, study, tmp_path):
        opened = jointz.open_study(self.rewritten(study, tmp_path))
        for own, first in zip(opened.recordings, jointz.open_study(study).recordings, strict=True):
            values, expected = own.read()[0]["shank_velocity"], first.read()[0]["shank_velocity"]
            assert values.attrs["units"] == "rad/s"
            np.testing.assert_allclose(values, expected, rtol=0, atol=1e-9)

    def test_a_recording_may_lack_a_sensor(self, study, tmp_path):
        opened = jointz.open_study(self.rewritten(study, tmp_path, drop=["unperturbed"]))
        level, pulsed = (entry.read()[0] for entry in opened.recordings)
        assert "shank_velocity" not in level
        assert "thigh_velocity" in level
        assert "shank_velocity" in pulsed

    def test_a_column_that_no_recording_has_is_a_mistake(self, study, tmp_path):
        folder = self.rewritten(
            study, tmp_path, toml=lambda text: text.replace('column = "shank', 'column = "schank')
        )
        with pytest.raises(StudyError, match="did you mean 'shank_velocity'"):
            jointz.open_study(folder)
