"""``jointz run``: determinism, both clocks, the plan, the study, the commands."""

import hashlib
import json

import numpy as np
import pandas as pd
import pytest

import jointz
from jointz.analysis.page.event_figures import draw_onset_accuracy
from jointz.analysis.paper.methods_text import methods_text
from jointz.core.session_log import WALKING
from jointz.io.formats.netcdf_recording import read_recording
from jointz.io.log_reader import read_log
from jointz.io.protocols import protocol_text
from jointz.results.run_report import RunReport

HOST_FIELDS = {"host_time_ns", "busy_us", "crc"}


@pytest.fixture(scope="module")
def made(short_walking, tmp_path_factory):
    protocol = short_walking(strides=12, people=2, count_per_point=3)
    return jointz.run(protocol, out=tmp_path_factory.mktemp("run") / "study", seed=3)


def hashes(study):
    """Logs, journals and recordings' numbers by their place in the study."""
    found = {
        str(path.relative_to(study)): hashlib.sha256(path.read_bytes()).hexdigest()
        for pattern in ("*.jzlog", "journal.jsonl", "plan.json", "*_pulses.csv", "study.toml")
        for path in study.rglob(pattern)
    }
    truth = json.loads((study / "ground_truth.json").read_text())
    return {**found, "truth": truth}


def test_seeds_and_not_workers_make_the_bytes(short_walking, tmp_path):
    points = {"LRE": 7.0, "ISW": 68.5}
    brief = short_walking(strides=4, people=2, count_per_point=1, timing_points=points)
    mine, again, theirs = (
        hashes(jointz.run(brief, out=tmp_path / name, seed=seed, workers=workers).study)
        for name, seed, workers in (("mine", 3, 1), ("again", 3, 2), ("theirs", 4, 1))
    )
    assert again == mine
    assert len(mine) >= 2 * (3 + 2 + 1) + 2
    for name in ("sessions/S01/plan.json", "sessions/S01/logs/unperturbed-0.jzlog", "study.toml"):
        assert mine[name] != theirs[name]


@pytest.mark.alone
def test_both_clocks_write_the_same_log_but_for_host_time(short_walking, tmp_path):
    brief = short_walking(conditions=["unperturbed"], strides=2)
    fast = jointz.run(brief, out=tmp_path / "fast", seed=3)
    log = "sessions/S01/logs/unperturbed-0.jzlog"
    virtual = read_log(fast.study / log)
    for attempt in range(5):  # where a slot was missed, the logs differ rightly
        real = jointz.run(brief, out=tmp_path / f"real-{attempt}", seed=3, clock="real")
        found = read_log(real.study / log)
        if np.array_equal(found.records["slot"], np.arange(found.records.size)):
            break
    assert found.header == virtual.header
    assert (found.records["host_time_ns"] != virtual.records["host_time_ns"]).any()
    for name in {field.name for field in WALKING.fields} - HOST_FIELDS:
        np.testing.assert_array_equal(
            found.records[name], virtual.records[name], err_msg=f"field {name}"
        )


def test_the_plan_is_kept(made):
    table = made.report.to_frame()
    assert set(table["completed"]) == set(table["planned"]) == {3}
    for row in made.report.gaps:
        assert row["fewest"] >= 3
        assert row["most"] <= 7 or row["longer_than_planned"] > 0


@pytest.fixture(scope="module")
def analysis(made):
    return jointz.analyze(made.study, method="matched_strides", resamples=20)


def test_the_study_is_analysed_with_nothing_special_and_without_the_truth_beside_it(made, analysis):
    assert analysis.n_standing > 30
    assert {p.timing_point for p in analysis.pulses} == {"LRE", "MST", "TST", "PSW", "ISW", "MSW"}
    assert all(abs(p.onset_s) < 1e4 for p in analysis.pulses)
    truth, aside = made.study / "ground_truth.json", made.study.with_name("truth.json")
    truth.rename(aside)
    try:
        blind = jointz.analyze(made.study, method="matched_strides", resamples=20)
    finally:
        aside.rename(truth)
    pd.testing.assert_frame_equal(blind.to_frame(), analysis.to_frame())


def test_the_scatter_of_the_onsets_is_the_same_number_everywhere(made, analysis):
    run, text = made.report.pooled_onsets(), methods_text(analysis)
    drawn = [t.get_text() for t in draw_onset_accuracy(analysis).axes[0].texts]

    for row in analysis.statistics["onset_accuracy"]:
        other = run.loc[row["timing_point"]]
        assert (row["n"], row["n_missing"]) == (other["n"], other["n_missing"])
        error = row["mean_pct"] - row["target_pct"]
        assert (error, row["sd_pct"]) == pytest.approx(
            (other["error_mean_pct"], other["error_sd_pct"]), abs=1e-6
        )
        assert f"± {row['sd_pct']:.2f} %, n {row['n']}" in text
        assert any(f"SD {row['sd_pct']:.2f} %" in label for label in drawn)
        assert f"SD {row['sd_pct']:.2f} (theory" in made.report.summary()


def test_recordings_hold_what_was_worn(made):
    with_device = read_recording(made.study / "S01_unperturbed.nc")
    assert {"angle", "contact", "current", "motor_angle", "command"} <= set(with_device)
    assert not with_device["command"].any()
    without = read_recording(made.study / "S01_no_device.nc")
    gyroscopes = {"shank_velocity", "thigh_velocity"}
    assert set(without) == {"angle", "contact", "joint_moment"} | gyroscopes


def test_the_pulse_table_and_the_command_agree(made):
    recording = read_recording(made.study / "S01_perturbed.nc")
    table = pd.read_csv(made.study / "S01_perturbed_pulses.csv")
    time, command = recording["time"].to_numpy(), recording["command"].to_numpy()
    starts = time[np.flatnonzero(np.diff((command != 0).astype(int), prepend=0) == 1)]
    np.testing.assert_allclose(table["onset_s"], starts, atol=1e-6)
    np.testing.assert_allclose(table["duration_s"], 0.25, atol=1e-6)


def test_the_report_survives_json_and_draws(made):
    again = RunReport.from_dict(json.loads(json.dumps(made.report.to_dict(), allow_nan=False)))
    assert again.to_dict() == made.report.to_dict()
    assert "36 of 36 pulses" in made.report.summary()
    assert made.report.plot().get_xlabel().startswith("Planned onset")


def test_the_command_runs_a_protocol_of_ones_own_and_prints_json(jointz, tmp_path):
    text = protocol_text("walking-pilot").replace("count_per_point = 50", "count_per_point = 2")
    (tmp_path / "mine.toml").write_text(text.replace("strides = 60", "strides = 8"))
    options = ("--participants", "1", "--workers", "1", "--json")
    outcome = jointz("run", tmp_path / "mine.toml", "--out", tmp_path / "s", *options)
    assert outcome.code == 0
    assert outcome.json["pulses_completed"] == outcome.json["pulses_planned"] == 12
    assert (tmp_path / "s" / "study.toml").is_file()


def test_bad_input_is_refused_before_anything_is_made(jointz, tmp_path):
    file, out = tmp_path / "mine.toml", tmp_path / "s"
    file.write_text(protocol_text("sea-bandwidth").replace('bench = "series-elastic"', ""))
    for protocol, place in ((file, "bench: missing"), ("wlaking", "'walking'")):
        outcome = jointz("run", protocol, "--out", out)
        assert outcome.code == 2
        assert place in outcome.err
        assert not out.exists()
    assert jointz("run", "walking", "--out", tmp_path).code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]
