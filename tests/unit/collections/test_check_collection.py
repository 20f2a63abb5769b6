"""What collect check finds in spoilt entries, and that it leaves sound ones alone."""

import shutil

import numpy as np
import pandas as pd
import pytest
from benchmarks.collection_entries import JOINTS, write_entry

from jointz.collections.checking.check_collection import check_collection
from jointz.core.errors import DataError

ESTIMATES, COVARIANCE = "estimates.csv", "covariance.csv"


def where(table, parameter):
    return table["parameter"].str.startswith(parameter)


def scale(table, factor, *parameters):
    for name in parameters:
        table.loc[table["parameter"] == name, ["value", "ci_low", "ci_high"]] *= factor


def turn_torque(spec, tables):
    table = tables[ESTIMATES]
    ends = -table[["value", "ci_high", "ci_low"]].to_numpy()
    table[["value", "ci_low", "ci_high"]] = ends


def whole_as_per_kg(spec, tables):
    scale(tables[ESTIMATES], 73.0, "stiffness_per_mass", "damping_per_mass")


def degrees(spec, tables):
    """Angles in degrees: all of K, B and J, and what belongs to them, are 57 times too small."""
    tables[ESTIMATES][["value", "ci_low", "ci_high"]] *= np.pi / 180.0
    tables[COVARIANCE].iloc[:, 3:6] *= (np.pi / 180.0) ** 2


def interval_beside(spec, tables):
    tables[ESTIMATES].loc[3, "ci_low"] = tables[ESTIMATES].loc[3, "value"] * 1.05


def person_twice(spec, tables):
    spec["participants"].append(dict(spec["participants"][0]))


def not_positive(spec, tables):
    tables[COVARIANCE].loc[lambda t: where(t, "damping"), "with_stiffness"] *= 20.0
    tables[COVARIANCE].loc[lambda t: where(t, "stiffness"), "with_damping"] *= 20.0


def printed_marked_as_estimates(spec, tables):
    tables[ESTIMATES][["ci_low", "ci_high"]] = np.nan


def set_spec(*path, value):
    def change(spec, tables):
        part = spec
        for key in path[:-1]:
            part = part[key]
        if value is None:
            del part[path[-1]]
        else:
            part[path[-1]] = value

    return change


def set_column(column, value, *, file=ESTIMATES, row=slice(None)):
    def change(spec, tables):
        tables[file].loc[row, column] = value

    return change


def phase_as_fraction(spec, tables):
    tables[ESTIMATES]["onset_gait_pct"] /= 100.0


CONDITION = ("conditions", 0)
PLANTED = {
    "N*m for N*m/kg": (whole_as_per_kg, "per_mass"),
    "unknown joint": (set_spec("joint", "name", value="kneee"), "joint_unknown"),
    "another joint": (set_spec("joint", "name", value="ankle"), "joint_direction"),
    "not the protocol's joint": (set_spec("protocol", value="walking"), "joint_differs"),
    "direction of another joint": (
        set_spec("joint", "positive", value="dorsiflexion"), "joint_direction"
    ),
    "interval beside its value": (interval_beside, "interval"),
    "interval without end": (set_column("ci_high", np.inf, row=3), "interval_missing"),
    "no timing point": (set_column("timing_point", "", row=3), "timing_point_missing"),
    "no licence": (set_spec("licence", value=None), "key_missing"),
    "no consent": (set_spec("ethics", "consent", value=None), "key_missing"),
    "person twice": (person_twice, "person_twice"),
    "hash of another file": (set_spec("hashes", value={ESTIMATES: "0" * 64}), "hash_differs"),
    "unit of a row": (set_column("unit", "N*m/deg", row=slice(0, 5)), "unit"),
    "other level": (set_column("ci_level", 0.9), "ci_level"),
    "covariance with gaps": (
        set_column("with_inertia", np.nan, file=COVARIANCE, row=slice(0, 9)),
        "covariance_not_positive_definite",
    ),
    "phase beyond the cycle": (set_column("onset_gait_pct", 107.0, row=4), "phase_range"),
    "phase as a fraction": (phase_as_fraction, "phase_range"),
    "an infinite value": (set_column("value", np.inf, row=3), "infinite"),
    "an infinite covariance": (
        set_column("with_inertia", np.inf, file=COVARIANCE, row=0), "infinite"
    ),
    "no pulse behind a value": (set_column("n_used", 0, row=slice(0, 9)), "n_used"),
    "covariance not positive definite": (not_positive, "covariance_not_positive_definite"),
    "covariance not symmetric": (
        set_column("with_damping", 0.0, file=COVARIANCE, row=0), "covariance_asymmetric"
    ),
    "no method": (set_column("method", "", row=slice(0, 2)), "method_missing"),
    "another method": (set_spec("method", "name", value="dissertation"), "method_differs"),
    "unknown status": (set_column("status", "fine", row=2), "status_unknown"),
    "value that does not stand": (set_column("status", "undecided", row=2), "status_value"),
    "printed values as estimates": (printed_marked_as_estimates, "printed_as_estimates"),
    "side not stated": (set_spec("joint", "side", value="not_stated"), "side_missing"),
    "no torque path": (set_spec("device", "torque", value="not_stated"), "torque_path_missing"),
    "age of one person": (set_spec("participants", 0, "age_band", value="27"), "age_band"),
    "nobody's values": (set_column("participant", "S099", row=0), "participant_unknown"),
    "file outside": (set_spec(*CONDITION, "estimates", value="../x.csv"), "table_unreadable"),
    "unknown key": (set_spec("walking_speed", value=1.2), "key_unknown"),
    "no calibration told": (set_spec("calibration", value={}), "key_value"),
}  # fmt: skip


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Ten sound entries: five joints, in gait and at rest."""
    root = tmp_path_factory.mktemp("sound")
    for k in range(10):
        joint = list(JOINTS)[k % len(JOINTS)]
        gait = ("walking", "running")[k % 2] if joint in ("knee", "ankle", "hip") else "seated"
        write_entry(root / f"lab-{k:02d}", seed=k, people=4, joint=joint, activity=gait)
    return root


def test_sound_entries_raise_no_alarm(sound):
    found = check_collection(sound)

    assert len(found.entries) == 10
    assert found.findings == ()


def onset_rows(spec, tables):
    """The method also estimated stiffness and damping at the onset."""
    table = tables[ESTIMATES]
    own = table[table["parameter"].isin(["stiffness", "damping"])]
    tables[ESTIMATES] = pd.concat([table, own.assign(parameter=own["parameter"] + "_onset")])
    spec["units"] |= {"stiffness_onset": "N*m/rad", "damping_onset": "N*m*s/rad"}


def test_parameters_at_the_onset_are_known_and_their_units_checked(tmp_path):
    write_entry(tmp_path / "lab", seed=3, change=onset_rows)
    assert check_collection(tmp_path).findings == ()


@pytest.mark.parametrize("slip", PLANTED)
def test_a_planted_error_is_caught_with_its_code(slip, tmp_path):
    change, code = PLANTED[slip]
    # The knee's protocol stands in the entry of an elbow.
    joint = "elbow" if code == "joint_differs" else "knee"
    write_entry(tmp_path / "lab", seed=3, joint=joint, change=change)

    found = check_collection(tmp_path)

    assert code in {finding.code for finding in found.findings}
    assert all(finding.entry == "lab" and finding.expected for finding in found.findings)


def half_of_the_people(spec, tables):
    tables[COVARIANCE] = tables[COVARIANCE][tables[COVARIANCE]["participant"] <= "S006"]


def one_parameter_less(spec, tables):
    tables[COVARIANCE] = tables[COVARIANCE][tables[COVARIANCE]["parameter"] != "damping"]


@pytest.mark.parametrize(
    "change", [lambda t: t.replace(b"\n", b"\r\n"), lambda t: b"\xef\xbb\xbf" + t]
)
def test_an_entry_written_on_another_system_is_the_same_entry(tmp_path, change):
    write_entry(tmp_path / "Labör - 2 [x]*", seed=3, change=set_spec("study", value="labor-2"))
    file = tmp_path / "Labör - 2 [x]*" / "entry.toml"
    file.write_bytes(change(file.read_bytes()))

    assert check_collection(tmp_path).findings == ()


@pytest.mark.parametrize("file", [ESTIMATES, COVARIANCE])
def test_an_empty_file_is_named_and_the_other_entries_are_looked_at(tmp_path, file):
    for name, seed in (("lab-a", 3), ("lab-b", 4)):
        write_entry(tmp_path / name, seed=seed)
    (tmp_path / "lab-a" / file).write_bytes(b"")

    found = check_collection(tmp_path)

    assert {finding.entry for finding in found.findings} == {"lab-a"}
    assert f"{file}: is empty" in found.summary()


# --- between entries -----------------------------------------------------------------------------


def test_the_same_tables_under_another_study_are_told_of_the_later_entry(tmp_path):
    write_entry(tmp_path / "lab-a", seed=3)
    shutil.copytree(tmp_path / "lab-a", tmp_path / "lab-b")
    text = (tmp_path / "lab-b" / "entry.toml").read_text()
    (tmp_path / "lab-b" / "entry.toml").write_text(text.replace('"lab-a"', '"lab-b"'))

    found = check_collection(tmp_path)

    assert {(f.entry, f.code) for f in found.findings} == {("lab-b", "values_twice")}
    assert "lab-a/estimates.csv" in found.summary()


def second_condition(written):
    """Give the entry a second condition, whose table is what ``written`` makes of the first."""

    def change(spec, tables):
        faster = spec["conditions"][0] | {"name": "faster", "estimates": "faster.csv"}
        del faster["covariance"]
        spec["conditions"].append(faster)
        tables["faster.csv"] = written(tables[ESTIMATES].copy())

    return change


def other_values(table):
    rng = np.random.default_rng(99)
    factor = rng.uniform(0.8, 1.25, (len(table), 1))
    inertia = (table["parameter"] == "inertia").to_numpy()[:, None]  # one fit of both conditions
    table[["value", "ci_low", "ci_high"]] *= np.where(inertia, 1.0, factor)
    return table[~table["parameter"].str.endswith("_per_mass")]


def test_a_table_of_one_condition_under_another_is_found(tmp_path):
    write_entry(tmp_path / "lab", seed=3, change=second_condition(lambda table: table))

    found = check_collection(tmp_path)

    assert {finding.code for finding in found.findings} == {"values_twice"}


def two_methods(spec, tables):
    table = tables[ESTIMATES]
    other = table.assign(method="dissertation")
    scale(other, 1.3, *other["parameter"].unique())
    middle = (other["ci_high"] + other["ci_low"]) / 2
    other["ci_low"] = middle - 9 * (middle - other["ci_low"])
    other["ci_high"] = middle + 9 * (other["ci_high"] - middle)
    tables[ESTIMATES] = pd.concat([table, other], ignore_index=True)


def bounded_and_undecided(spec, tables):
    table = tables[ESTIMATES]
    rows = table.index[table["parameter"] == "damping"][:2]
    table.loc[rows[0], ["value", "ci_low", "ci_high", "status"]] = [0.01, 0.0, 0.4, "at_bound"]
    table.loc[rows[1], ["value", "ci_low", "ci_high"]] = np.nan
    table.loc[rows[1], "status"] = "undecided"
    tables[ESTIMATES] = table[table["parameter"] != "damping_per_mass"]


def shared_inertia(spec, tables):
    table = tables[ESTIMATES]
    inertia = table["parameter"] == "inertia"
    one = table[inertia & (table["timing_point"] == "LRE")].assign(timing_point="all")
    one["onset_gait_pct"] = np.nan
    tables[ESTIMATES] = pd.concat([table[~inertia], one], ignore_index=True)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(half_of_the_people, id="covariances of some people"),
        pytest.param(one_parameter_less, id="covariances of some parameters"),
        pytest.param(second_condition(other_values), id="one inertia of both conditions"),
        pytest.param(two_methods, id="covariances of the method of the entry only"),
        pytest.param(bounded_and_undecided, id="at a bound and undecided"),
        pytest.param(shared_inertia, id="an inertia of all timing points"),
    ],
)
def test_a_sound_entry_has_no_problem(tmp_path, change):
    write_entry(tmp_path / "lab", seed=3, change=change)

    assert check_collection(tmp_path).findings == ()


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (set_spec("participants", 0, "person", value="anna-of-the-tale"), "person_twice"),
        (set_spec("study", value="the-study"), "study_twice"),
    ],
)
def test_a_person_or_a_study_in_two_entries_is_found_in_the_later(tmp_path, change, code):
    for name, seed in (("lab-a", 3), ("lab-b", 4)):
        write_entry(tmp_path / name, seed=seed, change=change)

    (finding,) = check_collection(tmp_path).findings

    assert (finding.entry, finding.code) == ("lab-b", code)


# --- what is not judged --------------------------------------------------------------------------

OF_EARLIER_VERSIONS = [
    {"code": "sign", "reason": "a load that pushes", "where": {"condition": "walking 0.7"}},
    {"code": "out_of_range", "reason": "all contracted as hard as they can"},
]


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(set_spec("licence", value="CC-BY-ND-4.0"), id="no derived works"),
        pytest.param(set_spec("licence", value="LicenseRef-ours"), id="licence of one's own"),
        pytest.param(set_spec("licence", value="ask us"), id="licence in words"),
        pytest.param(set_spec("ethics", "consent", value="study_only"), id="study only"),
        pytest.param(set_spec("ethics", "consent", value="as the form says"), id="in words"),
        pytest.param(set_spec("accepted", value=OF_EARLIER_VERSIONS), id="accepted findings"),
        pytest.param(turn_torque, id="negative values"),
        pytest.param(degrees, id="small values"),
        pytest.param(set_spec(*CONDITION, "walking_speed_m_s", value=4.3), id="fast"),
        pytest.param(set_spec("participants", 0, "height_m", value=172.0), id="tall"),
    ],
)
def test_licence_consent_and_plausibility_are_the_readers_to_judge(tmp_path, change):
    write_entry(tmp_path / "lab", seed=3, change=change)

    assert check_collection(tmp_path).findings == ()


@pytest.mark.parametrize("error", [PermissionError(13, "Permission denied"), OSError(5, "I/O")])
def test_a_file_that_cannot_be_read_is_named(tmp_path, monkeypatch, error):
    def refuse(path):
        raise error

    def vouch(spec, tables):
        spec["hashes"] = {"recordings.zip": "0" * 64}

    write_entry(tmp_path / "lab", seed=3, change=vouch)
    (tmp_path / "lab" / "recordings.zip").write_bytes(b"PK")
    monkeypatch.setattr("jointz.collections.checking.entry_checks.file_sha256", refuse)

    told = check_collection(tmp_path).summary()

    assert "hashes.recordings.zip: " in told
    assert "[file_unreadable]" in told


@pytest.mark.parametrize(
    ("column", "value", "code"),
    [("sd", np.inf, "infinite"), ("n", 7.5, "count")],
)
def test_printed_numbers_are_numbers(tmp_path, column, value, code):
    from jointz.collections.dissertation_entry import printed_values, write_dissertation_entry

    folder = write_dissertation_entry(tmp_path / "dissertation").parent
    assert check_collection(tmp_path).clean
    table = printed_values()
    table[column] = table[column].astype(float)
    table.loc[0, column] = value
    table.to_csv(folder / "printed.csv", index=False)

    codes = {finding.code for finding in check_collection(tmp_path).findings}

    assert code in codes


def test_a_folder_that_is_no_collection_is_refused(tmp_path):
    with pytest.raises(DataError, match="found none"):
        check_collection(tmp_path)
    with pytest.raises(DataError, match="cannot be read as a folder"):
        check_collection(tmp_path / "nowhere")
