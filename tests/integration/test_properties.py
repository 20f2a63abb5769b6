"""What must not change an estimate, and what must change it in proportion."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jointz import analyze
from jointz.core.recording import build_recording
from jointz.core.study import CalibrationSpec, PerturbationsSpec
from jointz.identify.participant import analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import WALKING

METHODS = ("dissertation", "pre_pulse", "matched_strides")
FEW = settings(
    max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def recording_of(simulated, condition, *, order=("angle", "torque", "command", "contact")):
    return build_recording(
        simulated["time"].to_numpy(),
        {name: simulated[name].to_numpy() for name in order},
        condition=condition,
        file=f"{condition}.csv",
        contact_kind="contact",
    )


@pytest.fixture(scope="module")
def simulated(small_study_source):
    return {
        condition: pd.read_csv(small_study_source / f"S01_{condition}.csv")
        for condition in ("unperturbed", "perturbed")
    }


@pytest.fixture(scope="module")
def pair(simulated):
    return [recording_of(s, c) for c, s in simulated.items()]


@pytest.fixture(scope="module")
def plain(pair):
    return numbers(run(pair))


def run(recordings, *, participant="S01", seed=0):
    setting = ParticipantSettings(
        kind=WALKING,
        perturbations=PerturbationsSpec(),
        methods=METHODS,
        n_resamples=40,
        seed=seed,
        mass_kg=70.0,
        coupling="rigid",
    )
    inputs = [RecordingInput(r, CalibrationSpec()) for r in recordings]
    return analyze_participant(participant, inputs, setting)


def numbers(result) -> pd.DataFrame:
    """Return value and interval of every method, point and parameter."""
    rows = [row for cells in result.cells.values() for cell in cells for row in cell.rows()]
    table = pd.DataFrame(rows).set_index(["method", "timing_point", "parameter"]).sort_index()
    return table[["value", "ci_low", "ci_high", "vaf_pct", "n_used", "n_excluded", "status"]]


def assert_same(found: pd.DataFrame, expected: pd.DataFrame, *, scale: float = 1.0) -> None:
    scaled = ["value", "ci_low", "ci_high"]
    size = expected[scaled].abs().max(axis=1).to_numpy()[:, None]
    difference = np.abs(found[scaled].to_numpy() / scale - expected[scaled].to_numpy())
    withheld = found[scaled].isna().to_numpy() & expected[scaled].isna().to_numpy()
    assert (withheld | (difference <= 1e-6 * size + 1e-9)).all(), (found, expected)
    rest = ["n_used", "n_excluded", "status"]
    pd.testing.assert_frame_equal(found[rest], expected[rest])
    np.testing.assert_allclose(found["vaf_pct"], expected["vaf_pct"], atol=1e-4)


def with_values(recording: xr.Dataset, **changed) -> xr.Dataset:
    return recording.assign(
        {n: ("time", np.asarray(v), recording[n].attrs) for n, v in changed.items()}
    )


def test_the_simulated_participant_has_estimates_to_compare(plain):
    assert len(plain) == 3 * 6 * 5
    assert (plain["status"] == "ok").mean() > 0.7


SAME = {
    "clock_shifted": lambda r: r.assign_coords(time=("time", r["time"].to_numpy() - 1000.0)),
    "clock_far_away": lambda r: r.assign_coords(time=("time", r["time"].to_numpy() + 1e4)),
    "turned": lambda r: with_values(
        r, angle=-r["angle"], torque=-r["torque"], command=-r["command"]
    ),
    "constants": lambda r: with_values(r, angle=r["angle"] + 0.7, torque=r["torque"] - 14.0),
}


@pytest.mark.parametrize("change", SAME.values(), ids=SAME)
def test_clock_direction_and_constants_change_nothing(pair, plain, change):
    assert_same(numbers(run([change(r) for r in pair])), plain)


@FEW
@given(scale=st.floats(0.05, 20.0))
def test_torque_times_a_number_is_impedance_times_it(pair, plain, scale):
    scaled = [
        with_values(r, torque=scale * r["torque"], command=scale * r["command"]) for r in pair
    ]
    assert_same(numbers(run(scaled)), plain, scale=scale)


@FEW
@given(order=st.permutations(["angle", "torque", "command", "contact"]), name=st.text(min_size=1))
def test_the_order_of_channels_and_recordings_and_the_name_of_the_person_change_nothing(
    simulated, plain, order, name
):
    other = [recording_of(s, c, order=order) for c, s in simulated.items()]
    pd.testing.assert_frame_equal(numbers(run(other[::-1], participant=name)), plain)


def test_the_same_seed_gives_the_same_numbers_and_another_other_intervals(pair, plain):
    pd.testing.assert_frame_equal(numbers(run(pair)), plain)
    other = numbers(run(pair, seed=1))
    assert (other["ci_low"] != plain["ci_low"]).mean() > 0.5
    plug_in = plain.loc["matched_strides", "value"]
    np.testing.assert_array_equal(other.loc["matched_strides", "value"], plug_in)


def whole(study):
    return analyze(study.root, resamples=20).to_frame()


def test_units_signs_order_and_names_change_nothing(small_study, small_analysis):
    """Degrees; torque on the device, its sign turned; columns and people in another order."""
    for file in small_study.root.glob("*.csv"):
        small_study.edit_table(
            file.name,
            lambda t: t.assign(angle=np.rad2deg(t["angle"]), torque=-t["torque"])[t.columns[::-1]],
        )
    small_study.edit_toml('unit = "rad"', 'unit = "deg"')
    small_study.edit_toml('torque_acts_on = "joint"', 'torque_acts_on = "device"')
    small_study.edit_toml('id = "S01"', 'id = "Zoe 7"')
    small_study.edit_toml('participant = "S01"', 'participant = "Zoe 7"')
    toml = small_study.toml
    first, second = toml.index("[[participants]]"), toml.rindex("[[participants]]")
    third = toml.index("[[recordings]]")
    swapped = toml[:first] + toml[second:third] + toml[first:second] + toml[third:]
    (small_study.root / "study.toml").write_text(swapped)

    found = whole(small_study)

    assert list(found["participant"].unique()) == ["S02", "Zoe 7"]
    found = found.replace({"participant": {"Zoe 7": "S01"}})
    found = found.sort_values("participant", kind="stable").reset_index(drop=True)
    # The search ends where the posterior hardly rises: rounding moves a value by some of that.
    pd.testing.assert_frame_equal(found, small_analysis.to_frame(), rtol=5e-3, atol=1e-9)


def test_another_participant_in_the_study_changes_nothing(small_study, small_analysis):
    own = small_analysis.to_frame().query("participant == 'S02'").reset_index(drop=True)
    toml = small_study.toml
    second = toml.rindex("[[participants]]")
    alone = toml[: toml.index("[[participants]]")] + toml[second : toml.index("[[recordings]]")]
    alone += toml[toml.index('[[recordings]]\nparticipant = "S02"') :]
    (small_study.root / "study.toml").write_text(alone)

    pd.testing.assert_frame_equal(whole(small_study), own)
