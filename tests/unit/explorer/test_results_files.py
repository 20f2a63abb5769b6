"""Results looked through: traces of pulses, exclusions, estimates made again."""

import json
import shutil
import threading
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jointz.analysis.analyze import analyze
from jointz.analysis.pulse_traces import PulseKey, ReestimationRequest, read_traces
from jointz.core.errors import DataError, WriteError
from jointz.explorer.exclusions import FILE, decide, is_excluded
from jointz.explorer.reestimation import estimate_by_method, reestimate, with_new_estimates
from jointz.explorer.results_files import cell_of, open_results, pulses_of
from jointz.io.study_reader import open_study
from jointz.results.log_posterior import LogPosterior

RESAMPLES = 50


@pytest.fixture
def made(rigid_results):
    return rigid_results


@pytest.fixture
def opened(made, tmp_path):
    """Results of a study that a test may change."""
    shutil.copytree(made / "study", tmp_path / "study")
    shutil.copytree(made / "results", tmp_path / "results")
    return open_results(tmp_path / "results")


@pytest.fixture(scope="module")
def again(rigid_results):
    found = open_results(rigid_results / "results")
    return renewed(found, found.people[0])


def first_pulse(found, k=0):
    person = found.people[0]
    point = found.analysed.cells[0].timing_point
    return pulses_of(found.analysed, person, point)[k]


def renewed(found, person):
    """Return results with new estimates of a person, these, and the traces of the pulses."""
    request = ReestimationRequest.of(found.analysed)
    result = reestimate(found.study, person, request)
    now = found.with_result(person, result)
    return now, result, read_traces(found.study, person, request, now.current())


def test_the_study_beside_the_results_is_found(opened, tmp_path):
    assert opened.study is not None
    assert opened.study.root == tmp_path / "study"
    assert opened.stale() == ()
    assert opened.command().startswith(f"jointz analyze {tmp_path / 'study'} --out")


def test_results_open_without_their_study(opened, tmp_path):
    (tmp_path / "study").rename(tmp_path / "elsewhere")

    alone = open_results(tmp_path / "results")
    named = open_results(tmp_path / "results", study=tmp_path / "elsewhere")

    assert alone.study is None
    assert (alone.stale(), alone.changed(), alone.more_methods()) == ((), (), ())
    assert alone.current() == alone.analysed
    assert named.study is not None


def test_another_study_is_refused(opened, tmp_path):
    toml = tmp_path / "study" / "study.toml"
    toml.write_text(toml.read_text() + "\n# changed\n")

    assert open_results(tmp_path / "results").study is None
    with pytest.raises(DataError, match=r"expected the study that was analysed for"):
        open_results(tmp_path / "results", study=tmp_path / "study")


def test_absent_and_damaged_results_are_refused(opened, tmp_path):
    with pytest.raises(DataError, match="expected a folder that jointz analyze made"):
        open_results(tmp_path)
    (tmp_path / "results" / "analysis.json").write_text('{"schema": 1')
    with pytest.raises(DataError, match=r"analysis\.json: cannot be read"):
        open_results(tmp_path / "results")


def test_posteriors_of_a_participant_are_replaced(again):
    found, result, _ = again
    person = found.people[0]
    one, eye = np.zeros(1), np.eye(1)
    posteriors = {
        name: LogPosterior(name, ("stiffness",), ("LRE",), one, eye, one, eye)
        for name in found.people
    }
    analysed = replace(found.analysed, log_posteriors=tuple(posteriors.values()))
    new = replace(posteriors[person], mean=one + 1.0)
    result = replace(result, log_posteriors=(new,))

    now = with_new_estimates(analysed, found.study, {person: result})

    expected = posteriors | {person: new}
    assert now.log_posteriors == tuple(expected.values())


def test_nothing_changed_gives_the_same_numbers(again):
    found, result, _ = again
    person = found.people[0]
    own = tuple(c for c in found.analysed.cells if c.participant == person)

    assert result.cells["bayesian"] == own


@pytest.mark.parametrize("method", ["bayesian", "dissertation"])
def test_responses_of_the_pulses_used_make_the_average(again, method):
    found, _, traces = again
    person = found.people[0]
    for cell in (c for c in found.analysed.cells if c.participant == person):
        cell = cell_of(found.analysed, person, cell.timing_point, method=method)
        if cell is None or cell.response is None:
            continue
        windows = [
            traces[PulseKey.of(p)].windows[method]
            for p in pulses_of(found.analysed, person, cell.timing_point)
            if not p.code
        ]
        angle = np.mean([w.response_angle for w in windows], axis=0)
        torque = np.mean([w.response_torque for w in windows], axis=0)
        n = cell.response.time_s.size
        np.testing.assert_allclose(angle[:n], cell.response.angle, atol=1e-9)
        np.testing.assert_allclose(torque[:n], cell.response.torque, atol=1e-9)
        np.testing.assert_allclose(windows[0].time_s[:n], cell.response.time_s, atol=1e-9)


def test_residuals_are_responses_minus_the_fit(again):
    _, _, traces = again
    windows = [w for t in traces.values() for w in t.windows.values() if w.fitted is not None]

    assert {w.fits for w in windows} == {"angle", "torque"}
    for window in windows:
        own = window.response_angle if window.fits == "angle" else window.response_torque
        fitted = np.isfinite(window.fitted)
        np.testing.assert_allclose((window.residual + window.fitted)[fitted], own[fitted])
        assert window.misfit == pytest.approx(np.sqrt(np.mean(window.residual[fitted] ** 2)))


def test_an_excluded_pulse_gives_what_a_fresh_analysis_gives_and_comes_back(opened, again):
    pulse = first_pulse(opened)
    found = opened.with_study(decide(opened.study, pulse, "exclude", reason="stumbled"))

    assert found.stale() == (pulse.participant,)
    assert [PulseKey.of(p) for p in found.changed()] == [PulseKey.of(pulse)]
    found, _, traces = renewed(found, pulse.participant)
    assert found.stale() == ()

    now, fresh = found.current(), analyze(found.study.root, resamples=RESAMPLES, seed=3)
    for name in ("cells", "comparison", "population", "pulses", "strides", "log_posteriors"):
        assert getattr(now, name) == getattr(fresh, name), name
    told = now.excluded_frame().query("code == 'user'")
    assert told["detail"].tolist() == ["stumbled"]
    old = cell_of(found.analysed, pulse.participant, pulse.timing_point)
    new = cell_of(now, pulse.participant, pulse.timing_point)
    assert new.n_used == old.n_used - 1
    assert new.parameters != old.parameters

    # It is shown as if it were restored.
    before, trace = (t[PulseKey.of(pulse)] for t in (again[2], traces))
    assert {w.shape for w in trace.windows.values()} == {-1}  # not averaged
    for method in ("bayesian", "dissertation"):
        np.testing.assert_allclose(
            trace.windows[method].response_angle, before.windows[method].response_angle
        )

    study = decide(found.study, pulse, "restore", reason="")
    assert not is_excluded(study, pulse)
    found = found.with_study(study)
    assert found.stale() == (pulse.participant,)
    assert found.changed() == ()
    found, _, _ = renewed(found, pulse.participant)
    assert found.current().cells == opened.analysed.cells


def test_changed_recordings_are_refused(opened):
    person = opened.people[0]
    entry = next(r for r in opened.study.spec.recordings if r.participant == person)
    file = opened.study.root / entry.file
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:-5]))

    with pytest.raises(DataError, match="expected the content that was analysed"):
        reestimate(opened.study, person, ReestimationRequest.of(opened.analysed))


def test_one_more_method_is_what_the_method_gives(opened):
    person = opened.people[0]
    assert "pre_pulse" in opened.more_methods()
    assert "full_record" not in opened.more_methods()

    cells = estimate_by_method(
        opened.study, person, ReestimationRequest.of(opened.analysed), method="pre_pulse"
    )
    found = opened.with_other("pre_pulse", person, cells)

    chosen = analyze(opened.study, method="pre_pulse", resamples=RESAMPLES, seed=3)
    assert {c.timing_point: c for c in cells} == {
        c.timing_point: c for c in chosen.cells if c.participant == person
    }
    assert found.methods() == ("bayesian", "dissertation", "pre_pulse")
    assert all(cell in found.current().comparison for cell in cells)


# exclusions.csv


def test_the_users_lines_stay_byte_for_byte(opened):
    file = opened.study.root / "exclusions.csv"
    own = (
        b"\xef\xbb\xbfwho,reason,participant,onset_s,recording,action\r\n"
        b'me,"a, ""b""\r\n c",S99,1.0,none.csv,exclude\r\n'
        b"me,,S99,1.0,none.csv,restore"  # without an end of line
    )
    file.write_bytes(own)
    study = open_study(opened.study.root)
    pulse = first_pulse(opened)

    study = decide(study, pulse, "exclude", reason='fell, "hard"\nagain')

    now = file.read_bytes()
    assert now.startswith(own + b"\r\n")
    assert now.endswith(b"\r\n")
    line = pd.read_csv(file, dtype=str, encoding="utf-8-sig", keep_default_na=False).iloc[-1]
    assert line["reason"] == 'fell, "hard" again'
    assert line["who"] == ""
    assert float(line["onset_s"]) == pulse.onset_s
    assert is_excluded(study, pulse)
    assert len(study.user_exclusions) == 3


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_lines_end_as_they_do_in_the_file(opened, ending):
    pulse = first_pulse(opened)
    file = opened.study.root / FILE
    lines = ["participant,recording,onset_s,action,reason", "x,y,1.5,exclude,old"]
    file.write_bytes(ending.join(lines).encode())
    study = decide(opened.study, pulse, "exclude", reason="stumbled")
    assert [line.reason for line in study.user_exclusions] == ["old", "stumbled"]
    assert file.read_bytes().count(ending.encode()) == 3


def test_a_file_system_without_locks_is_written_to_all_the_same(opened, monkeypatch):
    def refused(*_):
        raise OSError(9, "Bad file descriptor")  # what NFS says of a folder

    monkeypatch.setattr("fcntl.flock", refused)
    study = decide(opened.study, first_pulse(opened), "exclude", reason="stumbled")
    assert len(study.user_exclusions) == 1


def test_what_is_no_file_is_told(opened):
    (opened.study.root / FILE).mkdir()
    with pytest.raises(WriteError, match="Is a directory"):
        decide(opened.study, first_pulse(opened), "exclude", reason="stumbled")


def test_nothing_is_decided_about_another_study(opened):
    toml = opened.study.root / "study.toml"
    toml.write_text(toml.read_text() + "\n# another\n")
    with pytest.raises(DataError, match=r"study\.toml was changed"):
        decide(opened.study, first_pulse(opened), "exclude", reason="stumbled")
    assert not (opened.study.root / FILE).exists()


def test_pages_do_not_lose_each_others_lines(opened):
    pulses = opened.analysed.pulses[:12]
    threads = [
        threading.Thread(target=decide, args=(opened.study, p, "exclude"), kwargs={"reason": "x"})
        for p in pulses
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    study = open_study(opened.study.root)
    assert len(study.user_exclusions) == len(pulses)
    assert all(is_excluded(study, p) for p in pulses)


def test_what_is_decided_already_is_not_written_again(opened):
    pulse = first_pulse(opened)
    decide(opened.study, pulse, "exclude", reason="one")
    study = decide(opened.study, pulse, "exclude", reason="two")  # a page that is behind
    assert [line.reason for line in study.user_exclusions] == ["one"]


def test_a_reason_is_asked_for_and_kept_short(opened):
    pulse = first_pulse(opened)
    with pytest.raises(DataError, match="reason: missing"):
        decide(opened.study, pulse, "exclude", reason=" \n ")
    with pytest.raises(DataError, match="at most 300 letters, got 301"):
        decide(opened.study, pulse, "exclude", reason="x" * 301)
    assert not (opened.study.root / "exclusions.csv").exists()


def test_a_file_that_cannot_be_read_is_left_alone(opened):
    file = opened.study.root / "exclusions.csv"
    file.write_text("participant,onset_s\nS01,1\n")
    with pytest.raises(DataError, match="missing column"):
        decide(opened.study, first_pulse(opened), "exclude", reason="x")
    assert file.read_text() == "participant,onset_s\nS01,1\n"


def test_results_know_no_place_of_the_study(made):
    """Why --study is there: nothing of the machine is in a results folder."""
    told = json.loads((made / "results" / "provenance.json").read_text())
    assert str(made) not in json.dumps(told)
