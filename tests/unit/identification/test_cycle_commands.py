"""``jointz identify time-varying`` and ``phase-curve``."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from tests.unit.analysis.studies import bayesian_analysis

import jointz as package
from jointz.analysis.results_folder import write_results
from jointz.results.log_posterior import LogPosterior

RATE = 500.0
STRIDE_S, STRIDES = 1.0, 40


@pytest.fixture(scope="session")
def walking_table():
    """A joint of one stiffness, about 100 N*m/rad, under random torque, and a footswitch."""
    time = np.arange(int(STRIDES * STRIDE_S * RATE)) / RATE
    torque = lfilter([0.1], [1.0, -0.9], np.random.default_rng(0).standard_normal(time.size))
    angle = lfilter([3e-5], [1.0, -1.95, 0.953], torque)
    foot = (time % STRIDE_S < 0.6).astype(float)
    columns = {"t": time, "knee": np.rad2deg(angle), "tau": torque, "foot": foot}
    return pd.DataFrame(columns | {"fz": 800.0 * foot})


@pytest.fixture
def walk(tmp_path, walking_table):
    path = tmp_path / "walk.csv"
    walking_table.to_csv(path, index=False)
    return path


COLUMNS = ("--angle", "knee:deg", "--torque", "tau:Nm")
TIMED = (*COLUMNS, "--time", "t")
SMALL = ("--n-phases", 4, "--resamples", 200)


def test_the_curves_come_as_json_csv_and_figure(jointz, walk, tmp_path):
    out, figure = tmp_path / "curves.csv", tmp_path / "curves.svg"
    options = ("--contact", "foot", "--out", out, "--figure", figure, "--json")
    outcome = jointz("identify", "time-varying", walk, *TIMED, *SMALL, *options)

    assert outcome.code == 0
    found = outcome.json
    assert (found["model"], found["status"]) == ("time_varying", "ok")
    assert found["columns"]["angle"] == {"column": "knee", "unit": "deg"}
    assert found["columns"]["contact"]["column"] == "foot"
    (stiffness,) = (p for p in found["parameters"] if p["name"] == "stiffness")
    assert stiffness["value"] == pytest.approx([100.0] * 4, rel=0.03)
    table = pd.read_csv(out)
    assert list(table["value"][:4]) == pytest.approx(stiffness["value"])
    assert set(table["parameter"]) == {"stiffness", "damping", "inertia"}
    assert figure.stat().st_size > 1000


@pytest.mark.parametrize(
    ("source", "clock"),
    [
        (("--contact", "foot"), ("--rate", RATE)),
        (("--force", "fz:N"), ("--time", "t")),
        (("--heel-strikes", "strikes.txt"), ("--rate", RATE)),
    ],
)
def test_heel_strikes_of_any_source_give_the_same_strides(jointz, walk, monkeypatch, source, clock):
    monkeypatch.chdir(walk.parent)
    strikes = np.arange(1, STRIDES) * STRIDE_S
    walk.with_name("strikes.txt").write_text("".join(f"{time}\n" for time in strikes) + "\n")
    outcome = jointz("identify", "time-varying", walk, *COLUMNS, *clock, *SMALL, *source, "--json")

    assert outcome.code == 0
    assert outcome.json["n_used"] == STRIDES - 2
    assert outcome.json["stride_s"] == pytest.approx(STRIDE_S)


def test_a_summary_is_printed_unless_it_is_quiet(jointz, walk):
    arguments = ("identify", "time-varying", walk, *TIMED, *SMALL, "--contact", "foot")
    printed, quiet = jointz(*arguments), jointz(*arguments, "--quiet")

    assert printed.code == quiet.code == 0
    assert "decided at 4 of 4 phases" in printed.out
    assert (quiet.out, quiet.err) == ("", "")


def test_a_record_without_an_answer_exits_1_with_the_code(jointz, walk):
    pd.read_csv(walk).assign(knee=1.0).to_csv(walk, index=False)
    arguments = ("identify", "time-varying", walk, *TIMED, *SMALL, "--contact", "foot")
    outcome, plain = jointz(*arguments, "--json"), jointz(*arguments)

    assert outcome.code == plain.code == 1
    assert outcome.json["model"] == "time_varying"
    assert outcome.json["status"] == "failed:constant_angle"
    assert plain.err.startswith("jointz: ")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (TIMED, "--heel-strikes"),
        ((*TIMED, "--contact", "foot", "--force", "fz"), "one of them"),
        ((*COLUMNS, "--contact", "foot"), "--rate"),
        ((*TIMED, "--contact", "absent"), "absent"),
        ((*TIMED, "--contact", "foot", "--cutoff-hz", 1000), "cutoff_hz"),
        ((*TIMED, "--contact", "foot", "--n-phases", 0), "n_phases"),
        ((*TIMED, "--contact", "foot", "--out", "curves.xlsx"), "--out"),
        ((*TIMED, "--heel-strikes", "absent.txt"), "absent.txt"),
        ((*TIMED, "--heel-strikes", "words.txt"), "row 2"),
        ((*TIMED, "--heel-strikes", "few.txt"), "30 strides"),
    ],
)
def test_what_cannot_be_used_exits_2(jointz, walk, monkeypatch, arguments, word):
    monkeypatch.chdir(walk.parent)
    walk.with_name("words.txt").write_text("1.0\nheel\n")
    walk.with_name("few.txt").write_text("1.0\n2.0\n3.0\n")
    outcome = jointz("identify", "time-varying", walk, *arguments)
    assert outcome.code == 2
    assert word in outcome.err


def test_a_torque_that_does_not_move_the_joint_exits_1_without_an_estimate(jointz, walk):
    noise = np.random.default_rng(5).standard_normal(int(STRIDES * STRIDE_S * RATE))
    pd.read_csv(walk).assign(knee=noise).to_csv(walk, index=False)
    outcome = jointz("identify", "time-varying", walk, *TIMED, *SMALL, "--contact", "foot")

    assert outcome.code == 1
    assert "No parameter could be estimated" in outcome.out


# --- phase-curve ---------------------------------------------------------------------------------


def posterior_of(person, cells):
    """Return a posterior about the estimates of a person, alike at all timing points."""
    pairs = [(name, cell) for name in ("stiffness", "damping") for cell in cells]
    n = len(cells)
    prior = np.kron(np.eye(2), 0.2 + 0.3 * np.eye(n))
    return LogPosterior(
        person,
        parameters=tuple(name for name, _ in pairs),
        timing_points=tuple(cell.timing_point for _, cell in pairs),
        mean=np.log([cell.parameter(name).unbounded for name, cell in pairs]),
        covariance=0.05**2 * np.eye(2 * n),
        prior_mean=np.full(2 * n, 3.0),
        prior_covariance=prior,
    )


@pytest.fixture(scope="session")
def walked():
    """An analysis by the method bayesian with a posterior of each person."""
    made = bayesian_analysis(coupling="strap")
    own = {}
    for cell in made.cells:
        own.setdefault(cell.participant, []).append(cell)
    posteriors = tuple(posterior_of(person, mine) for person, mine in own.items())
    return replace(made, log_posteriors=posteriors)


@pytest.fixture(scope="session")
def results(walked, tmp_path_factory):
    folder = tmp_path_factory.mktemp("curves") / "results"
    write_results(walked, folder, figures=False)
    return folder


def test_phase_curves_are_those_of_python_as_json_csv_and_figure(jointz, results, tmp_path):
    out, figure = tmp_path / "curves.csv", tmp_path / "curves.png"
    options = ("--parameter", "damping", "--out", out, "--figure", figure, "--json")
    outcome = jointz("identify", "phase-curve", results, "--participant", "S02", *options)

    assert outcome.code == 0
    found = outcome.json
    assert (found["model"], found["status"]) == ("phase_curve", "ok")
    expected = package.phase_curve(package.load(results), "S02", parameters=["damping"])
    (band,) = found["bands"]
    assert band["value"] == pytest.approx(expected.band("damping", "S02").value)
    assert list(pd.read_csv(out)["value"]) == pytest.approx(band["value"])
    assert figure.stat().st_size > 1000


def test_phase_curves_of_everybody_are_summarised_unless_it_is_quiet(jointz, results):
    printed = jointz("identify", "phase-curve", results)
    quiet = jointz("identify", "phase-curve", results, "--quiet")

    assert printed.code == quiet.code == 0
    assert "damping              mean over people" in printed.out
    assert (quiet.out, quiet.err) == ("", "")


def test_a_bench_has_no_phase_curve_and_exits_1_with_the_code(jointz, bench, tmp_path):
    write_results(bench, tmp_path / "results", figures=False)
    outcome = jointz("identify", "phase-curve", tmp_path / "results", "--json")
    assert outcome.code == 1
    assert outcome.json["status"] == "failed:no_pulses"


def test_a_parameter_without_estimates_is_named(jointz, results):
    outcome = jointz("identify", "phase-curve", results, "--parameter", "stiffness_per_mass")
    assert outcome.code == 1
    assert "no participant has estimates of stiffness_per_mass" in outcome.err


def test_a_changed_file_of_the_results_is_named_without_a_traceback(jointz, walked, tmp_path):
    write_results(walked, tmp_path / "results", figures=False)
    (tmp_path / "results" / "estimates.csv").write_text("changed")
    outcome = jointz("identify", "phase-curve", tmp_path / "results", "--json")

    assert outcome.code == 0
    assert json.loads(outcome.out)["bands"]
    assert outcome.err.startswith("jointz: ")
    assert "estimates.csv" in outcome.err


def test_results_of_the_former_rigid_are_refused(jointz, recommended, tmp_path):
    write_results(recommended, tmp_path / "results", figures=False)
    outcome = jointz("identify", "phase-curve", tmp_path / "results")
    assert outcome.code == 2
    assert "Analyse the study again" in outcome.err


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--participant", "S99"), "S99"),
        (("--parameter", "torque"), "torque"),
        (("--figure", "curve.txt"), "--figure"),
        (("--out", "curve.json"), "--out"),
    ],
)
def test_what_phase_curve_cannot_use_exits_2(jointz, results, options, word):
    outcome = jointz("identify", "phase-curve", results, *options)
    assert outcome.code == 2
    assert word in outcome.err


def test_a_folder_without_results_exits_2(jointz, tmp_path):
    outcome = jointz("identify", "phase-curve", tmp_path)
    assert outcome.code == 2
    assert "analysis.json" in outcome.err
