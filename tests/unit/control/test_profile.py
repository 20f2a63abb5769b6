"""Profiles: what is in them, what is refused, and their files."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.control.made_study import (
    DAMPING,
    STIFFNESS,
    cell,
    estimate,
    made_analysis,
    means,
    stride,
)

from jointz.control.impedance_profile import LAW, PROFILE_UNITS
from jointz.control.make_profile import impedance_profile
from jointz.control.profile_file import profile_of, profile_text, read_profile, write_profile
from jointz.core.errors import DataError, EstimationError, OutputError
from jointz.results.estimates import ParameterEstimate
from jointz.results.log_posterior import LogPosterior

POINTS = tuple(STIFFNESS)


def test_torque_along_the_mean_stride_is_its_moment(profile):
    torque = profile.torque(profile.gait_pct, profile.angle, profile.velocity)
    np.testing.assert_allclose(torque, profile.moment, atol=1e-9)


def test_curves_go_by_the_estimates_and_are_wider_between_them(profile):
    for knot in profile.knots:
        assert profile.at("stiffness", knot.stiffness_pct) == pytest.approx(
            knot.stiffness, rel=0.02
        )
        assert knot.stiffness == STIFFNESS[knot.timing_point]
        assert knot.damping == DAMPING[knot.timing_point]
    width = np.log(profile.stiffness_high / profile.stiffness_low)
    at = [round(knot.stiffness_pct) for knot in profile.knots]
    assert np.delete(width, at).mean() > 1.5 * width[at].mean()
    assert (profile.stiffness_low > 0.0).all()


def test_interval_of_the_equilibrium_holds_the_moments_error():
    wide = replace(stride("S01"), moment_sd=np.full(101, 30.0))
    narrow = impedance_profile(made_analysis(), "S01")
    unsure = impedance_profile(made_analysis(strides=[wide]), "S01")
    i = round(narrow.knots[2].stiffness_pct)  # the stiffness is known best at a timing point
    reach = 1.96 * 30.0 / np.sqrt(60.0) / narrow.stiffness[i]
    before, after = (0.5 * (p.equilibrium_high - p.equilibrium_low)[i] for p in (narrow, unsure))
    assert after == pytest.approx(np.hypot(before, reach), rel=0.1)


def test_known_lag_and_gain_are_taken_out_of_the_angle():
    lag_s, gain = 0.011, 1.05
    lag = ParameterEstimate("angle_lag", lag_s, lag_s - 0.002, lag_s + 0.002, "ok")
    made = made_analysis()
    found = replace(made, cells=tuple(replace(c, nuisance=(lag,)) for c in made.cells))
    found.provenance["study"]["calibration"] = {"angle_gain": {"value": gain, "sd": 0.01}}
    own = impedance_profile(found, "S01")
    shown = stride("S01")
    later = np.interp(own.gait_pct + 1.0, shown.gait_pct, shown.angle, period=100.0) / gain
    np.testing.assert_allclose(own.angle, later, atol=1e-6)
    assert not any("lag" in text for text in own.warnings)
    assert any("lag" in text for text in impedance_profile(made_analysis(), "S01").warnings)


def test_work_of_the_moment(profile):
    turned = np.diff(np.append(profile.angle, profile.angle[0]))
    middle = 0.5 * (profile.moment + np.roll(profile.moment, -1))
    assert profile.energy_j == pytest.approx(float(middle @ turned), abs=1e-9)
    assert profile.energy_low_j < profile.energy_j < profile.energy_high_j
    assert profile.damping_loss_j > 0.0


def test_without_a_moment_a_published_one_is_taken_and_named():
    own = impedance_profile(made_analysis(strides=[stride("S01", moment=False)]), "S01")
    assert "Winter" in own.sources["moment"]
    assert any("published" in text for text in own.warnings)
    with pytest.raises(DataError, match="joint_moment"):
        impedance_profile(
            made_analysis(strides=[stride("S01", moment=False)], joint="ankle"), "S01"
        )


def test_stride_with_a_moment_is_preferred():
    both = [stride("S01", moment=False), stride("S01", condition="no_device")]
    assert "no_device" in impedance_profile(made_analysis(strides=both), "S01").sources["moment"]


def test_mean_over_people_goes_with_body_mass():
    group = impedance_profile(made_analysis(population=means()))
    assert group.scales_with_mass
    assert group.mass_kg == pytest.approx(67.5)
    other = impedance_profile(made_analysis(population=means()), mass_kg=90.0)
    np.testing.assert_allclose(other.stiffness, group.stiffness * 90.0 / 67.5)
    np.testing.assert_allclose(other.equilibrium, group.equilibrium)
    assert other.knots[0].damping == pytest.approx(group.knots[0].damping * 90.0 / 67.5)
    one = impedance_profile(made_analysis(), "S01")
    with pytest.raises(ValueError, match="S01"):
        one.for_mass(80.0)


def test_small_displacements_are_preferred():
    cells = [
        replace(
            cell("S01", point),
            parameters=(
                *cell("S01", point).parameters,
                estimate("stiffness_onset", 1.2 * STIFFNESS[point]),
                estimate("damping_onset", DAMPING[point]),
            ),
        )
        for point in POINTS
    ]
    own = impedance_profile(made_analysis(cells), "S01")
    assert own.displacement == "onset"
    assert own.knots[0].stiffness == pytest.approx(1.2 * STIFFNESS[own.knots[0].timing_point])
    assert impedance_profile(made_analysis(), "S01").displacement == "window"


def posterior(**more):
    names = ("stiffness", "damping", "stiffness_onset", "damping_onset")
    values = (STIFFNESS, DAMPING, STIFFNESS, DAMPING)
    mean = np.log([value[point] for value in values for point in POINTS])
    covariance = 0.01 * np.eye(mean.size)
    return LogPosterior(
        "S01", tuple(n for n in names for _ in POINTS), POINTS * 4, mean, covariance,
        mean, np.eye(mean.size), **more,
    )  # fmt: skip


def test_posterior_of_a_strapped_leg_carries_its_covariance():
    own = impedance_profile(replace(made_analysis(), log_posteriors=(posterior(),)), "S01")
    assert own.displacement == "onset"
    np.testing.assert_allclose(own.covariance, 0.01 * np.eye(12))
    knot = own.knots[0]
    assert np.log(knot.stiffness_high / knot.stiffness) == pytest.approx(0.196, abs=1e-3)


def test_doubted_posterior_is_refused():
    doubted = posterior(doubts=("softening",), doubted=(False,) * 12 + (True,) + (False,) * 11)
    with pytest.raises(EstimationError, match="LRE"):
        impedance_profile(replace(made_analysis(), log_posteriors=(doubted,)), "S01")


def test_interval_that_reaches_zero_is_refused_with_the_pulses_that_help():
    cells = [
        replace(
            cell("S01", point),
            parameters=tuple(
                replace(p, unbounded=p.value) for p in cell("S01", point).parameters
            ),
            budget={
                "stiffness": {"noise": (0.55 if point == "ISW" else 0.05) * STIFFNESS[point]},
                "damping": {"noise": 0.05 * DAMPING[point]},
            },
        )
        for point in POINTS
    ]  # fmt: skip
    with pytest.raises(EstimationError, match=r"ISW reaches zero. About 60 pulses .*50 so far"):
        impedance_profile(made_analysis(cells), "S01")


def test_too_few_timing_points_are_refused():
    cells = [cell("S01", point) for point in POINTS[:3]]
    with pytest.raises(EstimationError, match="3 timing points, expected 4"):
        impedance_profile(made_analysis(cells), "S01")


@pytest.mark.parametrize(
    ("analysis", "participant", "text"),
    [
        (made_analysis(), "S09", "S01; S02"),
        (made_analysis(masses={"S01": 75.0}), "S01", "no mass of S02"),
        (replace(made_analysis(), mean_strides=()), "S01", "Analyse the study again"),
    ],
)
def test_unknown_people_masses_and_strides_are_refused(analysis, participant, text):
    with pytest.raises(DataError, match=text):
        impedance_profile(analysis, participant)


def test_published_knee_has_the_dissertations_means(published):
    assert published.mass_kg == pytest.approx(73.39)
    assert published.knots[0].stiffness == pytest.approx(2.13 * 73.39, rel=0.01)
    assert published.sources["impedance"].startswith("published")
    assert published.moment[14] == pytest.approx(-0.62 * 73.39)


# --- files ---------------------------------------------------------------------------------------


def test_file_gives_every_bit_back(profile, tmp_path):
    file = write_profile(profile, tmp_path / "p.json")
    again = read_profile(file)
    assert again == profile
    assert json.loads(file.read_text())["units"]["stiffness"] == "N*m/rad"
    with pytest.raises(OutputError, match="exists"):
        write_profile(profile, file)


def _edited(profile, tmp_path, **changes):
    content = json.loads(profile_text(profile)) | changes
    file = tmp_path / "edited.json"
    file.write_text(json.dumps(content))
    return file


@pytest.mark.parametrize(
    "changes",
    [{"mass_kg": 80.0}, {"joint": "ankle"}, {"stiffness": [1.0] * 100}, {"sha256": "0"}, {"x": 1}],
)
def test_edited_file_is_refused(profile, tmp_path, changes):
    with pytest.raises(DataError, match="was changed after jointz wrote it"):
        read_profile(_edited(profile, tmp_path, **changes))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": 1', "\x00", '{"schema": "x/1"}'])
def test_other_files_are_refused(tmp_path, text):
    file = tmp_path / "other.json"
    file.write_text(text)
    with pytest.raises(DataError, match=r"other\.json"):
        read_profile(file)
    with pytest.raises(DataError, match=r"none\.json"):
        read_profile(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gait_pct", np.arange(50.0)),
        ("stiffness", np.full(100, np.nan)),
        ("covariance", np.full((2, 3), 1.0)),
        ("damping_low", np.full(100, 1e3)),
        ("equilibrium", np.full(100, 20.0)),
        ("energy_j", np.inf),
        ("mass_kg", -1.0),
    ],
)
def test_whole_file_with_impossible_numbers_is_refused(profile, name, value):
    content = profile.to_dict() | {"law": LAW, "units": dict(PROFILE_UNITS)}
    content[name] = np.asarray(value).tolist()
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    signed = content | {"sha256": hashlib.sha256(text.encode()).hexdigest()}
    with pytest.raises(DataError, match=name.partition("_")[0]):
        profile_of(signed, "here")


@pytest.mark.parametrize(("name", "value"), [("mass_kg", 0.0), ("covariance", np.array(1e-12))])
def test_no_profile_is_made_of_impossible_numbers(published, name, value):
    with pytest.raises(DataError, match=f"{name}: expected"):
        replace(published, **{name: value})


def test_onset_is_taken_of_both_or_of_none():
    cells = [
        replace(
            cell("S01", point),
            parameters=(
                *cell("S01", point).parameters,
                estimate("stiffness_onset", 1.3 * STIFFNESS[point]),
            ),
        )
        for point in POINTS
    ]
    own = impedance_profile(made_analysis(cells), "S01")
    assert (own.displacement, own.knots[0].stiffness) == ("window", 150.0)


def test_sessions_and_sides_of_a_person_are_no_people():
    sides = [
        replace(stride(person), side=side, angle=stride(person).angle + (side == "left") * 0.1)
        for person in ("S01", "S02")
        for side in ("left", "right")
    ]
    group = impedance_profile(made_analysis(strides=sides, population=means()))
    assert "2 people" in group.sources["angle"]
    # The sides differ, the people do not.
    np.testing.assert_allclose(group.angle_sd, 0.0, atol=1e-12)


def test_people_without_a_moment_are_counted():
    some = [stride("S01"), stride("S02", moment=False)]
    group = impedance_profile(made_analysis(strides=some, population=means()))
    assert any("1 of 2 people" in text for text in group.warnings)
    assert group.mass_kg == pytest.approx(67.5)
    assert group.energy_low_j < group.energy_high_j


def test_device_has_no_part_in_the_error():
    whole = posterior(intrinsic=(("stiffness_onset", 15.0), ("damping_onset", 0.0)))
    own = impedance_profile(replace(made_analysis(), log_posteriors=(whole,)), "S01")
    knot = own.knots[-1]
    assert knot.stiffness == pytest.approx(STIFFNESS[knot.timing_point] - 15.0)
    sd = np.sqrt(own.covariance[5, 5])
    assert sd == pytest.approx(0.1 * STIFFNESS[knot.timing_point] / knot.stiffness)


@pytest.mark.parametrize("mass_kg", [0.0, -5.0, np.nan, np.inf])
def test_masses_of_nobody_are_refused(mass_kg):
    with pytest.raises(DataError, match="1 to 500 kg"):
        impedance_profile(mass_kg=mass_kg)


def test_published_curve_goes_by_the_means(published):
    for knot in published.knots:
        assert published.at("stiffness", knot.stiffness_pct) == pytest.approx(
            knot.stiffness, rel=0.05
        )
