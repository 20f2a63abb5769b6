"""Sampling rates that strides and pulses contradict."""

import re

import numpy as np
import pandas as pd
import pytest

from jointz.analysis.participant_jobs import read_participant
from jointz.core.errors import StudyError
from jointz.identify.preparation.pulses import pulses_from_command
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study

TIME = '[channels.time]\ncolumn = "time"\nunit = "s"\n'


def without_time(study, rate_hz):
    study.edit_toml(TIME, "")
    study.edit_toml("jointz = 1\n", f"jointz = 1\nsample_rate_hz = {rate_hz}\n")


def with_tables(study, scale):
    """Name the pulses of the commands in tables; a command is then no channel."""
    opened = open_study(study.root)
    for entry in opened.spec.recordings:
        if entry.condition == "perturbed":
            (recording,) = read_recording(opened, entry)
            start = float(recording["time"][0])
            onsets = [scale * (p.onset_s - start) for p in pulses_from_command(recording)]
            name = f"{entry.participant}_pulses.csv"
            (study.root / name).write_text("\n".join(["onset_s", *map(repr, onsets)]))
            study.edit_toml(
                f'file = "{entry.file}"', f'file = "{entry.file}"\nperturbations = "{name}"'
            )
    study.edit_toml('[channels.command]\ncolumn = "command"\nunit = "N*m"\n', "")


def problem_of(study):
    """Return why the first participant's recordings are refused."""
    opened = open_study(study.root)
    try:
        read_participant(opened, opened.spec.participants[0].id, {})
    except StudyError as exc:
        return str(exc)
    return ""


@pytest.mark.parametrize(
    ("rate_hz", "stride"),
    [(1000.0, "0.5"), (100.0, "5."), (250.0, "2.1"), (700.0, "0.7"), (500.0, ""), (300.0, "")],
)
def test_a_declared_rate_at_which_nobody_walks_is_refused_with_the_likely_one(
    small_study, rate_hz, stride
):
    without_time(small_study, rate_hz)

    problem = problem_of(small_study)

    assert bool(problem) == bool(stride)
    if stride:
        assert f"its strides last {stride}" in problem
        assert re.search("Likely rate: .*500 Hz", problem)


def test_small_people_may_step_faster(small_study):
    without_time(small_study, 700.0)
    toml = re.sub("height_m = .*", "height_m = 1.1", small_study.toml)
    (small_study.root / "study.toml").write_text(toml)

    assert not problem_of(small_study)


def test_stamps_of_slow_walking_are_no_problem(small_study):
    for file in small_study.root.glob("*.csv"):
        small_study.edit_table(file.name, lambda t: t.assign(time=2.0 * t["time"]))

    assert not problem_of(small_study)


def with_lengths(study, duration_s):
    for file in study.root.glob("*_pulses.csv"):
        study.edit_table(file.name, lambda t: t.assign(duration_s=duration_s))


def without_strikes(study):
    study.edit_toml('[channels.contact]\ncolumn = "contact"\nkind = "contact"\n', "")


COMMAND = '[channels.command]\ncolumn = "command"\nunit = "N*m"\n'


@pytest.mark.parametrize(
    ("rate_hz", "command", "refused"),
    [
        (500.0, True, False),
        (400.0, True, True),
        (600.0, True, True),
        (250.0, True, True),
        (500.0, False, False),
        (250.0, False, True),
        (1000.0, False, True),
    ],
)
def test_pulses_longer_or_shorter_than_their_table_are_refused_with_the_rate(
    small_study, rate_hz, command, refused
):
    """The onsets were read off the record, at the wrong rate; the lengths are the protocol's."""
    with_tables(small_study, 500.0 / rate_hz)
    with_lengths(small_study, 0.25)
    without_time(small_study, rate_hz)
    without_strikes(small_study)
    if command:
        small_study.edit_toml("[channels.angle]", COMMAND + "[channels.angle]")

    problem = problem_of(small_study)

    assert ("500 Hz" in problem) == refused
    assert bool(problem) == refused


def test_lengths_of_another_definition_or_that_no_rate_explains_are_no_problem(small_study):
    """Pulses of 250 ms: stated with a pause that no usual rate explains, or not at all."""
    with_tables(small_study, 1.0)
    without_time(small_study, 500.0)
    for duration_s in (0.23, 0.27, 0.25 * 500 / 440, np.nan):
        with_lengths(small_study, duration_s)
        assert not problem_of(small_study)


@pytest.mark.parametrize(
    ("scale", "declared", "likely"),
    [(1.0, 600.0, 500), (1.0, 400.0, 500), (1.0, 480.0, 500), (500.0 / 512.0, 500.0, 512)],
)
def test_onsets_tell_rates_that_are_near_one_another_or_rare(small_study, scale, declared, likely):
    with_tables(small_study, scale)
    without_time(small_study, declared)

    assert f"likely {likely}" in problem_of(small_study)


def test_stamps_at_which_nobody_walks_are_warned_of_first(small_study, jointz, tmp_path):
    for file in small_study.root.glob("*.csv"):
        small_study.edit_table(file.name, lambda t: t.assign(time=t["time"] / 2))

    quick = ("--method", "pre_pulse", "--resamples", 2, "--no-figures")
    done = jointz("analyze", small_study.root, "--out", tmp_path / "out", *quick)

    assert done.out.startswith("WARNING: ")
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.index("strides last 0.5") < page.index("<nav>")


@pytest.mark.parametrize("scale", [1.0, 0.5, 2.0])
def test_a_pulse_table_of_another_clock_is_refused_with_the_rate_that_fits(small_study, scale):
    with_tables(small_study, scale)
    without_time(small_study, 500.0)

    assert (f"likely {500 / scale:g}" in problem_of(small_study)) == (scale != 1.0)


def test_pulses_that_cannot_be_seen_make_no_rate_likely(small_study):
    with_tables(small_study, 1.0)
    noise = np.random.default_rng(5)
    for file in small_study.root.glob("*perturbed.csv"):
        small_study.edit_table(file.name, lambda t: t.assign(torque=noise.standard_normal(len(t))))

    assert not problem_of(small_study)


@pytest.mark.parametrize("factor", [1.0, 1000.0])
def test_rounded_stamps_fit_their_onsets_and_another_unit_does_not(small_study, factor):
    """Whole milliseconds at 300 Hz have a median step of 333 Hz."""
    own_hz = 300.0
    with_tables(small_study, factor * 500.0 / own_hz)
    for file in small_study.root.glob("*perturbed.csv"):
        small_study.edit_table(
            file.name, lambda t: t.assign(time=(np.arange(len(t)) / own_hz).round(3))
        )

    problem = problem_of(small_study)

    assert (f"{1 / factor:.4g} times" in problem) == (factor != 1.0)
    assert bool(problem) == (factor != 1.0)


@pytest.mark.parametrize("refused", [True, False])
def test_onsets_beyond_the_end_are_told_with_a_rate_at_which_they_fit(small_study, refused):
    """Too few to tell the rate by what they do to the torque."""
    with_tables(small_study, 1.0)
    without_time(small_study, 500.0)
    for file in small_study.root.glob("*_pulses.csv"):
        onset = pd.read_csv(file)["onset_s"].to_numpy(copy=True)[:5]
        onset[-2:] *= 20 if refused else 1
        pd.DataFrame({"onset_s": onset}).to_csv(file, index=False)

    problem = problem_of(small_study)

    assert ("2 of 5 onsets" in problem) == refused
