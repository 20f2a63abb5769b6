"""What differs between recordings: parts of one file, columns, signs, scales, layouts."""

import numpy as np
import pytest
from scipy.io import savemat

from jointz.core.errors import DataError

from .conftest import samples

ANGLE = np.deg2rad(samples()["knee_angle_deg"].to_numpy())


def test_a_scale_and_an_inversion_come_before_the_unit(study):
    study.tables(lambda t: t.assign(knee_angle_deg=t["knee_angle_deg"] / -90.0))
    study.edit('unit = "deg"', 'unit = "deg"\nscale = 90.0\ninvert = true')

    recording = study.read()[0]

    np.testing.assert_allclose(recording["angle"], ANGLE, rtol=1e-12)
    assert '"factors": {"angle": -90.0}' in recording.attrs["history"]


def test_a_scaled_column_may_state_the_unit_of_the_sensor(study):
    study.tables(lambda t: t.rename(columns={"torque_nm": "M [V]"}))
    study.edit('column = "torque_nm"', 'column = "M [V]"\nscale = 50.0')

    torque = study.read()[0]["torque"]

    np.testing.assert_allclose(torque, 50.0 * samples()["torque_nm"])
    study.edit('scale = 50.0\nunit = "N*m"', "scale = 50.0")
    with pytest.raises(DataError, match="Give unit: that of the numbers times scale"):
        study.read()


def test_a_switch_that_is_low_on_the_ground_is_inverted(study):
    study.edit('kind = "contact"', 'kind = "contact"\ninvert = true')

    contact = study.read()[0]["contact"]

    np.testing.assert_array_equal(contact, -samples()["footswitch"])


@pytest.mark.parametrize("scale", ["0.0", "nan", "inf"])
def test_a_scale_is_a_number_other_than_zero(study, scale):
    study.edit('unit = "deg"', f'unit = "deg"\nscale = {scale}')

    assert study.sole_problem().startswith("channels.angle.scale: ")


def test_a_torque_per_body_mass_is_multiplied_by_it(study):
    study.edit('column = "torque_nm"\nunit = "N*m"', 'column = "torque_nm"\nunit = "Nm/kg"')

    recording = study.read()[0]

    np.testing.assert_allclose(recording["torque"], 72.4 * samples()["torque_nm"])
    assert recording["torque"].attrs["units"] == "N*m"
    study.edit("mass_kg = 72.4", "height_m = 1.8")
    assert "per body mass. Give mass_kg of S01." in study.sole_problem()


def test_a_recording_changes_columns_signs_and_units_of_channels(study):
    study.table("S01_ewp.csv", lambda t: t.assign(knee_left=-np.deg2rad(t["knee_angle_deg"])))
    change = '{ column = "knee_left", unit = "rad", positive = "extension" }'
    study.edit('file = "S01_ewp.csv"', f'file = "S01_ewp.csv"\nchannels = {{ angle = {change} }}')

    for number in (0, 1):
        np.testing.assert_allclose(study.read(number)[0]["angle"], ANGLE)


def test_a_change_of_a_channel_that_the_study_lacks_is_refused(study):
    study.edit(
        'file = "S01_ewp.csv"', 'file = "S01_ewp.csv"\nchannels = { current = { unit = "A" } }'
    )

    assert study.sole_problem().startswith("recordings[2].channels.current: the study has no")


def test_problems_of_a_change_are_told_with_the_recording(study):
    study.edit(
        'file = "S01_ewp.csv"',
        'file = "S01_ewp.csv"\nchannels = { angle = { unit = "kg", column = "gone" } }',
    )

    unit, column = study.refused().problems

    assert unit.startswith("recordings[2].channels.angle.unit: 'kg' measures")
    assert column.startswith("recordings[2].file: S01_ewp.csv has no column 'gone'")


def test_a_file_of_another_layout_states_its_own(study):
    content = samples().to_csv(index=False, sep=";", decimal=",")
    (study.root / "S01_ewp.csv").write_bytes(("Gerät 2\n" + content).encode("cp1252"))
    study.edit(
        'file = "S01_ewp.csv"',
        'file = "S01_ewp.csv"\nfiles = { delimiter = ";", decimal = ",", skip_rows = 1, '
        'encoding = "cp1252" }',
    )

    for number in (0, 1):
        np.testing.assert_allclose(study.read(number)[0]["angle"], ANGLE)


@pytest.mark.parametrize("layout", ["fields", "array"])
def test_one_matlab_struct_holds_everything(study, tmp_path, layout):
    own = {name: samples()[name].to_numpy() for name in samples()}
    other = own | {"knee_angle_deg": own["knee_angle_deg"] + 1.0}
    if layout == "fields":
        content, column = {"S01": {"walk": own, "push": other}}, "all.S01.{part}."
        parts = ("walk", "push")
    else:
        kind = [(name, object) for name in own]
        content = np.empty((1, 2), dtype=kind)
        for k, one in enumerate((own, other)):
            for name, values in one.items():
                content[0, k][name] = values
        column, parts = "all.", ("1", "2")
    savemat(tmp_path / "all.mat", {"all": content})
    for name in own:
        end = f"{name}.{{part}}" if layout == "array" else name
        study.edit(f'column = "{name}"', f'column = "{column}{end}"')
    for file, part in zip(("S01_enp.csv", "S01_ewp.csv"), parts, strict=True):
        study.edit(f'file = "{file}"', f'file = "all.mat"\npart = "{part}"')

    for number, shift in ((0, 0.0), (1, 1.0)):
        expected = ANGLE + np.deg2rad(shift)
        np.testing.assert_allclose(study.read(number)[0]["angle"], expected)


def test_a_joined_file_has_a_layout_and_a_scale_of_its_own(study):
    gyroscope = samples()[["time_s"]].assign(gyro=np.arange(50) / 10.0)
    text = gyroscope.to_csv(index=False, sep=";", decimal=",")
    (study.root / "shank.csv").write_text(text)
    joined = (
        '[[recordings.joined]]\nfile = "shank.csv"\noffset_s = 0.0\n'
        'files = { delimiter = ";", decimal = "," }\n[recordings.joined.channels]\n'
        'time = { column = "time_s" , unit = "s" }\n'
        'shank_velocity = { column = "gyro", scale = 10.0, invert = true }\n'
    )
    study.edit('perturbations = "S01_pulses.csv"', f'perturbations = "S01_pulses.csv"\n{joined}')

    np.testing.assert_allclose(study.read(1)[0]["shank_velocity"], -np.arange(50.0))


def test_labels_have_no_scale(study):
    study.channel("trial", "scale = 2.0", column="footswitch")

    assert study.sole_problem().startswith("channels.trial: labels have no scale")


def test_without_a_mass_a_changed_unit_per_mass_is_refused(study):
    study.edit("mass_kg = 72.4", "height_m = 1.8")
    study.edit('file = "S01_ewp.csv"', 'file = "S01_ewp.csv"\nchannels.torque.unit = "Nm/kg"')

    with pytest.raises(DataError, match="Give mass_kg"):
        study.read(1)
