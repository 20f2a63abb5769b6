"""The recommended estimator on walkers with known joints, and on recordings that are no good."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from jointz.core.study import (
    Calibrated,
    CalibrationSpec,
    ParticipantSpec,
    PerturbationsSpec,
    UserExclusion,
)
from jointz.identify.rigid.gravity import gravity_stiffness, hanging_masses
from jointz.identify.rigid.response_model import Priors
from jointz.identify.rigid.walking_responses import known_together, priors_of

PARAMETERS = ("stiffness", "damping", "inertia")


def cell(result, point):
    return next(c for c in result.cells["rigid"] if c.timing_point == point)


def statuses(result):
    return {p.status for c in result.cells["rigid"] for p in c.parameters}


def codes(result):
    return {p.code for p in result.pulses}


def truths(joint):
    return dict(zip(PARAMETERS, (joint.K, joint.B, joint.J), strict=True))


def off(result, walker):
    """Return errors in units of the interval's half width, of all decided values."""
    found = []
    for point, joint in walker.joints.items():
        for name, truth in truths(joint).items():
            p = cell(result, point).parameter(name)
            if p.available:
                found.append(2.0 * abs(p.value - truth) / (p.ci_high - p.ci_low))
    return found


def changed(given, **channels):
    """Return a recording with other values in some channels."""
    recording = given.recording.copy(deep=True)
    for name, change in channels.items():
        recording[name] = recording[name].copy(data=change(recording[name].to_numpy()))
    return replace(given, recording=recording)


@pytest.fixture(scope="module")
def usual(walkers):
    walker = walkers.Walker()
    return walker, walkers.walk(walker)


@pytest.fixture(scope="module")
def estimated(walkers, usual):
    """Return the result for the usual walker."""
    return walkers.analyze(*usual)


# --- recovery -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes",
    [
        {"known_lag_sd_s": None},
        {"signs": (1.0, -1.0)},
        {"sizes_nm": (8.0, 17.0)},
        {"rate_hz": 100.0},
        {"jitter_s": 2e-4},
        {"start_s": 1000.0},
        {"counts": {"A": 3, "B": 30}},
        {"points": {"A": 0.5, "B": 99.5}},
    ],
    ids=str,
)
def test_known_joints_come_back_within_their_intervals(walkers, changes):
    walker = walkers.Walker(**changes)
    result = walkers.analyze(walker)
    errors = off(result, walker)
    # Few pulses and an unknown lag, or a slow rate, leave the two inertias open.
    assert len(errors) >= 4
    # Half widths are 1.96 sd; 3.3 sd is one in a thousand.
    assert max(errors) < 1.7
    assert codes(result) == {""}


def test_values_are_near_the_truth_not_only_inside_wide_intervals(usual, estimated):
    walker, _ = usual
    assert max(off(estimated, walker)) < 1.7
    assert codes(estimated) == {""}
    for point, joint in walker.joints.items():
        for name, truth in truths(joint).items():
            p = cell(estimated, point).parameter(name)
            assert p.status == "ok"
            assert p.ci_high - p.ci_low < 0.6 * truth
            assert p.value == pytest.approx(truth, rel=0.25)


def test_three_pulses_a_point_are_estimated_or_undecided_fewer_are_too_few(walkers):
    few = walkers.analyze(walkers.Walker(counts={"A": 1, "B": 2}, between=20))
    assert statuses(few) == {"failed:too_few_pulses"}
    walker = walkers.Walker(counts={"A": 3, "B": 3}, between=10)
    result = walkers.analyze(walker)
    assert statuses(result) <= {"ok", "undecided", "at_bound"}
    assert max(off(result, walker), default=0.0) < 1.7
    for p in (p for c in result.cells["rigid"] for p in c.parameters[:3]):
        if p.status == "undecided":
            assert (p.value, p.ci_low, p.ci_high) == (None, None, None)
            assert np.isfinite(p.unbounded)


@pytest.mark.parametrize("K", [0.0, 2.0])
def test_a_joint_without_stiffness_gets_a_one_sided_limit_with_a_width(walkers, K):
    joints = {"A": walkers.Joint(K, 2.5, 0.06), "B": walkers.Joint(60.0, 3.0, 0.06)}
    walker = walkers.Walker(joints=joints, counts={"A": 40, "B": 40})
    p = cell(walkers.analyze(walker), "A").parameter("stiffness")
    assert p.status in ("at_bound", "ok", "undecided")
    if p.available:
        assert p.ci_low <= K <= p.ci_high
        assert p.ci_high - p.ci_low > 3.0
    if p.status == "at_bound":
        assert p.ci_low == 0.0


def test_two_recordings_of_unlike_rates_are_estimated_together(walkers):
    walker = walkers.Walker()
    both = [walkers.walk(replace(walker, seed=k, rate_hz=r)) for k, r in ((0, 1000.0), (1, 250.0))]
    result = walkers.analyze(walker, *both)
    assert [c.n_used for c in result.cells["rigid"]] == [40, 40]
    assert max(off(result, walker)) < 1.7


def test_turning_both_signs_changes_nothing(walkers, usual, estimated):
    walker, given = usual
    other = changed(given, angle=np.negative, torque=np.negative)
    table = given.pulse_table.assign(amplitude_nm=-given.pulse_table["amplitude_nm"])
    turned = walkers.analyze(walker, replace(other, pulse_table=table))
    for point in walker.joints:
        for name in PARAMETERS:
            a, b = (cell(r, point).parameter(name) for r in (estimated, turned))
            assert a.value == pytest.approx(b.value, rel=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_gravity_is_that_of_the_posture_to_which_the_pulses_moved_the_joint(walkers, sign):
    person = ParticipantSpec(id="S01", mass_kg=73.0, height_m=1.74)
    result = walkers.analyze(walkers.Walker(signs=(sign,)), person=person)
    masses = hanging_masses("knee", person)
    seen = 0
    (evidence,) = result.evidence
    for at, response in zip(evidence.cells, evidence.responses, strict=True):
        estimate = cell(result, at.label)
        stiffness = estimate.parameter("stiffness")
        if estimate.gravity_corrected is None:
            continue
        moved = float(response.angle.mean())
        assert moved > 0.02  # turned by the sign
        gravity = gravity_stiffness(
            masses,
            joint="knee",
            angle_rad=at.predicted.posture_rad + sign * moved,
            gait_pct=estimate.centre_gait_pct,
        )
        assert stiffness.value - estimate.gravity_corrected.value == pytest.approx(gravity.value)
        seen += 1
    assert seen


# --- what is left out -----------------------------------------------------------------------------


def test_a_pulse_by_a_run_of_missing_samples_is_left_out_and_the_others_stand(walkers, usual):
    walker, given = usual
    time = given.recording["time"].to_numpy()
    onset = float(given.pulse_table["onset_s"].iloc[5])

    def holed(x):
        return np.where((time > onset + 0.02) & (time < onset + 0.05), np.nan, x)

    result = walkers.analyze(walker, changed(given, angle=holed))
    assert [p.code for p in result.pulses].count("not_finite") == 1
    assert sum(c.n_used for c in result.cells["rigid"]) == 39
    assert max(off(result, walker)) < 1.7


def test_a_recording_without_strikes_gives_a_reason(walkers, usual):
    walker, given = usual
    result = walkers.analyze(walker, changed(given, contact=np.zeros_like))
    assert statuses(result) == {"failed:no_heel_strikes"}


@pytest.mark.parametrize("kept", [0, 9])
def test_too_few_unperturbed_strides_give_a_reason(walkers, usual, kept):
    walker, given = usual
    result = walkers.analyze(walker, given, user_exclusions=all_but(given, kept))
    assert statuses(result) == {"failed:no_unperturbed_strides"}
    assert "no_baseline" in codes(result)


def all_but(given, kept: int):
    """Return exclusions of all strides but so many that can be learned from."""
    contact = given.recording["contact"].to_numpy()
    strikes = given.recording["time"].to_numpy()[1:][np.diff(contact.astype(float)) > 0.5]
    onsets = given.pulse_table["onset_s"].to_numpy()
    held = np.searchsorted(strikes, onsets) - 1
    # Two after each pulse: the one before must be without a pulse too.
    quiet = [k for k in range(5, strikes.size - 1) if k not in held and k - 1 not in held]
    return tuple(
        UserExclusion("S01", given.file, float(strikes[k]), "exclude", "test")
        for k in range(strikes.size - 1)
        if k in quiet[kept:] or (kept == 0 and k < 5)
    )


def lamed(walkers, walker, every: int, *channels: str):
    """Return a recording in which every so-manieth pulse is missing from some channels."""
    there = walkers.walk(walker)
    still = walkers.walk(replace(walker, sizes_nm=(1e-9,)))
    time = there.recording["time"].to_numpy()
    mask = np.zeros(time.size, dtype=bool)
    for onset in there.pulse_table["onset_s"].to_numpy()[::every]:
        mask |= (time >= onset) & (time < onset + 0.9)
    spliced = {
        name: np.where(mask, still.recording[name], there.recording[name]) for name in channels
    }
    return changed(there, **{name: lambda _, x=x: x for name, x in spliced.items()})


@pytest.mark.parametrize(
    ("every", "channels", "code", "count"),
    [(4, ("angle", "torque"), "no_torque", 10), (5, ("angle",), "no_response", 8)],
)
def test_pulses_that_never_came_or_missed_the_joint_are_left_out(
    walkers, usual, every, channels, code, count
):
    walker, _ = usual
    result = walkers.analyze(walker, lamed(walkers, walker, every, *channels))
    assert [p.code for p in result.pulses].count(code) == count
    assert max(off(result, walker)) < 1.7


def test_pulses_planned_without_torque_are_left_out_and_hide_no_others(walkers):
    walker = walkers.Walker(sizes_nm=(17.0, 0.0))
    given = walkers.walk(walker)
    planned = given.pulse_table["amplitude_nm"].to_numpy()
    result = walkers.analyze(walker, given)
    assert [p.code == "no_torque" for p in result.pulses] == (planned == 0.0).tolist()
    assert sum(c.n_used for c in result.cells["rigid"]) > 15


@pytest.mark.parametrize(
    ("every", "channels", "status"),
    [(1, ("angle", "torque"), "failed:constant_torque"), (2, ("angle",), "failed:constant_angle")],
)
def test_where_most_pulses_never_came_or_missed_the_joint_there_is_no_estimate(
    walkers, usual, every, channels, status
):
    walker, _ = usual
    result = walkers.analyze(walker, lamed(walkers, walker, every, *channels))
    assert statuses(result) == {status}


def test_a_pulse_table_a_stride_late_is_no_estimate(walkers, usual):
    walker, given = usual
    table = given.pulse_table.assign(onset_s=given.pulse_table["onset_s"] + 1.1)
    result = walkers.analyze(walker, replace(given, pulse_table=table))
    assert statuses(result) <= {"failed:out_of_step", "failed:constant_torque"}


def test_copies_of_a_pulse_count_once(walkers, usual):
    walker, given = usual
    time = given.recording["time"].to_numpy()
    onsets = given.pulse_table["onset_s"].to_numpy()
    span = np.arange(-300, 200)

    def copied(x):
        x = x.copy()
        first: dict[str, int] = {}
        for onset, label in zip(onsets, given.pulse_table["timing_point"], strict=True):
            at = int(np.searchsorted(time, onset))
            source = first.setdefault(label, at)
            x[at + span] = x[source + span]
        return x

    result = walkers.analyze(walker, changed(given, angle=copied, torque=copied))
    assert [p.code for p in result.pulses].count("copied_pulse") >= 36
    assert all(c.n_used <= 2 for c in result.cells["rigid"])


# --- instruments ----------------------------------------------------------------------------------


def shifted(by_s: float, rate_hz: float = 500.0) -> Callable[[np.ndarray], np.ndarray]:
    return lambda x: np.roll(x, round(by_s * rate_hz))


@pytest.mark.parametrize(
    ("channels", "status"),
    [
        ({"torque": np.negative}, "failed:opposite_sign"),
        ({"angle": np.negative}, "failed:opposite_sign"),
        ({"angle": np.degrees}, "failed:angle_out_of_range"),
        ({"angle": shifted(0.035)}, "failed:lag_out_of_range"),
        ({"torque": shifted(0.04)}, "failed:out_of_step"),
        ({"torque": lambda x: x.clip(max=10.0)}, "failed:torque_saturated"),
        ({"torque": lambda x: 0.02 * x}, "failed:constant_torque"),
        ({"angle": lambda x: 0.3 + 0.0 * x}, "failed:constant_angle"),
    ],
    ids=lambda x: x if isinstance(x, str) else "+".join(x),
)
def test_a_recording_that_cannot_be_gives_its_reason_and_no_number(walkers, channels, status):
    walker = walkers.Walker(known_lag_sd_s=None)
    result = walkers.analyze(walker, changed(walkers.walk(walker), **channels))
    assert statuses(result) == {status}
    assert all(p.value is None for c in result.cells["rigid"] for p in c.parameters)


def test_a_lag_unlike_its_calibration_is_told(walkers):
    walker = walkers.Walker(counts={"A": 50, "B": 50})
    late = changed(walkers.walk(walker), angle=shifted(0.02))
    result = walkers.analyze(walker, late)
    told = {"failed:lag_out_of_range", "failed:model_misfit"}
    assert statuses(result) <= told


def test_a_window_in_which_k_may_do_anything_is_refused(walkers):
    walker = walkers.Walker()
    spec = PerturbationsSpec(timing_points=dict(walker.points), source="table", window_s=0.15)
    result = walkers.analyze(walker, walkers.walk(walker), perturbations=spec)
    assert statuses(result) == {"failed:window_too_long"}
    assert result.models == ()


def test_a_lag_measured_in_one_of_two_sessions_is_not_perfect_in_the_other():
    told = CalibrationSpec(angle_lag_s=Calibrated(value=0.006, sd=0.0005))
    mean_s, sd_s = priors_of(known_together([told, CalibrationSpec()])).lag_s
    assert mean_s == pytest.approx(0.5 * (0.006 + 0.012))
    assert sd_s == pytest.approx(0.5 * np.hypot(0.0005, 0.010))
    assert priors_of(known_together([CalibrationSpec()] * 2)).lag_s == Priors().lag_s


def test_twist_and_tissue_are_the_priors_of_the_sensor_and_wide_in_another_session():
    told = CalibrationSpec(
        angle_per_torque=Calibrated(value=6e-4, sd=2e-5),
        angle_gain=Calibrated(value=1.2, sd=0.0),
        tissue_hz=Calibrated(value=24.0, sd=1.2),
    )
    priors = priors_of(told)
    assert priors.cross_talk == pytest.approx((5e-4, 2e-5 / 1.2))
    assert priors.log_resonance == pytest.approx((np.log(24.0), 0.05))
    both = priors_of(known_together([told, CalibrationSpec()]))
    assert both.cross_talk[1] > 0.4 * Priors().cross_talk[1]
    assert both.log_resonance[1] > 0.4 * Priors().log_resonance[1]
    exact = priors_of(told.model_copy(update={"angle_per_torque": Calibrated(value=0.0, sd=0.0)}))
    assert 0.0 < exact.cross_talk[1] <= 1e-6


# --- calibration ----------------------------------------------------------------------------------


def covered(walkers, seeds, **changes):
    inside, decided, zero = 0, 0, 0
    for seed in seeds:
        walker = walkers.Walker(seed=1000 + seed, **changes)
        result = walkers.analyze(walker)
        for point, joint in walker.joints.items():
            for name, truth in truths(joint).items():
                p = cell(result, point).parameter(name)
                if p.available:
                    decided += 1
                    inside += p.ci_low <= truth <= p.ci_high
                    zero += p.ci_high - p.ci_low <= 0.0
    return inside, decided, zero


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"known_lag_sd_s": None},
        {"counts": {"A": 3, "B": 3}, "between": 6},
        {"counts": {"A": 10, "B": 10}},
        {"rate_hz": 250.0},
    ],
    ids=str,
)
def test_intervals_hold_the_truth_as_often_as_they_say(walkers, changes):
    n = 200
    inside, decided, zero = covered(walkers, range(n), **changes)
    # Six values of a walker go together at worst: the band is that of n, not of 6 n, draws.
    low, _ = binom.interval(0.95, n, 0.95)
    assert inside / decided >= low / n
    assert zero == 0


# --- what measuring would help --------------------------------------------------------------------


def test_what_knowing_the_lag_would_leave_is_what_it_leaves(walkers):
    few = {"counts": {"A": 10, "B": 10}}
    unknown, known = (
        walkers.analyze(walkers.Walker(known_lag_sd_s=sd_s, **few)) for sd_s in (None, 1e-5)
    )
    for point in few["counts"]:
        before, after = cell(unknown, point), cell(known, point)
        for name in ("stiffness", "damping", "inertia"):
            variance = sum(sd**2 for sd in before.budget[name].values())
            left = np.sqrt(variance - before.through_instruments[name]["lag"] ** 2)
            sd = np.linalg.norm(list(after.budget[name].values()))
            # In % of the value, which moves as well.
            relative = left / before.parameter(name).unbounded
            assert relative == pytest.approx(sd / after.parameter(name).unbounded, rel=0.45)
            assert after.through_instruments[name]["lag"] < 0.1 * sd
        inertia = before.budget["inertia"]
        # The budget alone does not tell: most of what the lag leaves open is counted as noise.
        through = before.through_instruments["inertia"]["lag"]
        assert through > max(inertia["lag"], 0.7 * np.linalg.norm(list(inertia.values())))
