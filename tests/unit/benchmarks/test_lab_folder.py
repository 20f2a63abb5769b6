"""The files of the lab's folder hold the simulated trials, in every form."""

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")

from benchmarks.lab_folder import forms, planted, scores, simulation  # noqa: E402


@pytest.fixture(scope="module")
def person() -> simulation.Person:
    return simulation.draw_people(5, count=1, pulses_a_point=2)[0]


@pytest.fixture(scope="module")
def lab(person: simulation.Person, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("lab")
    for form in forms.WRITERS:
        forms.write_study(form, [person], out / form, seed=5)
    return out


def test_every_form_holds_the_trials(lab: Path, person: simulation.Person) -> None:
    trial = person.trials["perturbed"]
    angles = {}

    mat = loadmat(lab / "mat" / f"{person.id}.mat", squeeze_me=True, struct_as_record=False)
    record = mat["trial"][1]
    angles["mat"] = record.mocap.time, record.mocap.kneeAngle
    np.testing.assert_array_equal(record.events.heelStrike, trial.strikes_s)
    np.testing.assert_array_equal(record.daq.motorCurrent, trial.current_a)
    edges, durations = simulation.find_edges(record.daq.time, record.daq.pulseTrigger)
    assert edges.size == 6
    np.testing.assert_allclose(durations, simulation.PULSE_S, atol=0.0011)

    stem = f"{person.id}_perturbed"
    tables = {p.stem: pd.read_csv(p) for p in (lab / "csv").glob(f"{stem}*.csv")}
    mocap, daq = tables[f"{stem}_mocap"], tables[f"{stem}_daq"]
    angles["csv"] = mocap["time_s"] + forms.CSV_OFFSET_S, mocap["knee_extension_deg"]
    np.testing.assert_allclose(daq["sync_V"], trial.trigger_v, atol=1e-5)
    np.testing.assert_allclose(tables[f"{stem}_strikes"]["heel_strike_s"], trial.strikes_s)

    c3d = ezc3d.c3d(str(lab / "c3d" / f"{stem}.c3d"))
    point, analog = c3d["data"]["points"][0, 0], c3d["data"]["analogs"][0]
    angles["c3d"] = np.arange(point.size) / c3d["parameters"]["POINT"]["RATE"]["value"][0], point
    assert c3d["parameters"]["ANALOG"]["RATE"]["value"][0] == 1000
    np.testing.assert_allclose(analog[0], trial.current_a[: analog.shape[1]], atol=1e-5)
    event = c3d["parameters"]["EVENT"]
    right = np.array(event["CONTEXTS"]["value"]) == "Right"
    times = np.array([60, 1]) @ event["TIMES"]["value"][:, right]
    np.testing.assert_allclose(times, trial.strikes_s, atol=1e-4)

    for form in scores.REFERENCES:
        log, pulses = (pd.read_csv(lab / form / f"{stem}{end}.csv") for end in ("", "_pulses"))
        angles[form] = log["t_s"], log["knee_extension_deg"]
        np.testing.assert_allclose(pulses["onset_s"], edges, atol=1 / 200)
        assert log["stride"].iloc[-1] == trial.strikes_s.size

    for stamps, angle in angles.values():
        error = np.asarray(angle) - trial.angle_deg(np.asarray(stamps))
        assert np.abs(error).max() < 6 * trial.angle_noise_deg


def test_every_study_file_names_files_that_exist(lab: Path) -> None:
    for form in forms.WRITERS:
        study = tomllib.loads((lab / form / "study.toml").read_text())
        assert study["perturbations"]["timing_points"] == simulation.POINTS
        for recording in study["recordings"]:
            joined = [entry["file"] for entry in recording.get("joined", [])]
            keys = recording.keys() & {"file", "heel_strikes", "perturbations"}
            for name in (*joined, *(recording[key] for key in keys)):
                assert (lab / form / name).exists()


def test_every_fault_changes_the_trial(person: simulation.Person) -> None:
    before = person.trials["perturbed"]
    for name in planted.FAULTS.keys() - {"trigger_noise_20mV"}:
        after = planted.plant([person], name, 5)[0].trials["perturbed"]
        changed = not np.array_equal(before.trigger_v, after.trigger_v)
        changed |= not np.array_equal(before.strikes_s, after.strikes_s)
        changed |= before.angle_offset_s != after.angle_offset_s
        assert changed or before.angle_rate_error != after.angle_rate_error, name
    bounced = planted.plant([person], "trigger_bounce", 5)[0].trials["perturbed"]
    assert simulation.find_edges(bounced.daq_s, bounced.trigger_v)[0].size == 18


def test_counts_of_intervals_and_wrong_estimates() -> None:
    rows = [
        (100.0, 90.0, 80.0, 101.0, "ok"),
        (100.0, 150.0, 140.0, 160.0, "ok"),
        (100.0, np.nan, np.nan, 120.0, "undecided"),
        (100.0, np.nan, np.nan, np.nan, "failed:no_pulses"),
    ]
    cells = pd.DataFrame(rows, columns=["truth", "value", "ci_low", "ci_high", "status"])
    assert scores.count(cells) == {
        "cells": 4,
        "ok": 2,
        "undecided": 1,
        "failed": 1,
        "intervals": 3,
        "hold_truth": 2,
        "ok_and_hold_truth": 1,
        "ok_but_30pct_off": 1,
    }
