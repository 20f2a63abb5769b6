"""Sessions and sides of one person: rows of their own, one person in every mean."""

import shutil

import pandas as pd
import pytest

from jointz.analysis.analyze import analyze
from jointz.analysis.page.details_tables import details_frame
from jointz.analysis.page.report_page import render_report
from jointz.analysis.paper.paper_tables import paper_tables
from jointz.analysis.pulse_traces import ReestimationRequest, read_traces
from jointz.analysis.results_folder import write_results
from jointz.comparison.compare import compare_results
from jointz.core.errors import StudyError
from jointz.explorer.reestimation import reestimate, with_new_estimates
from jointz.explorer.results_files import open_results
from jointz.io.study_reader import open_study
from jointz.results.study_analysis import StudyAnalysis
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

RESAMPLES = 5
KEYS = ["participant", "session", "side"]
VALUES = ["timing_point", "parameter", "value", "ci_low", "ci_high", "vaf_pct", "n_used", "status"]


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    """Two studies of the same two people, who are measured twice."""
    folder = tmp_path_factory.mktemp("halves")
    for name, seed in (("one", 7), ("two", 8)):
        plan = WalkPlan(per_point=4)
        simulate_study(folder / name, participants=2, plan=plan, unperturbed_strides=20, seed=seed)
    first = (folder / "one" / "study.toml").read_text()
    (folder / "two" / "study.toml").write_text(first)  # the same bodies
    return folder


def joined(halves, out, states):
    """Join both studies into one, each recording with what is stated of its half."""
    head, *entries = (halves / "one" / "study.toml").read_text().split("[[recordings]]")
    parts = [head]
    for name, stated in states.items():
        shutil.copytree(halves / name, out / name)
        for entry in entries:
            placed = entry.replace('perturbations = "', f'perturbations = "{name}/')
            parts.append(placed.replace('file = "', f'{stated}\nfile = "{name}/'))
    (out / "study.toml").write_text("[[recordings]]".join(parts))
    return out


STATED = {
    "sides": {"one": 'side = "left"', "two": 'side = "right"'},
    "sessions": {"one": 'session = "day 1"', "two": 'session = "day 2"'},
    "both": {
        "one": 'session = "day 1"\nside = "left"',
        "two": 'session = "day 2"\nside = "right"',
    },
}
#: Session and side of each half.
OF_HALF = {"one": ("day 1", "left"), "two": ("day 2", "right")}


@pytest.fixture(scope="module")
def analysed(halves, tmp_path_factory):
    """The joint study, and its analysis."""
    out = joined(halves, tmp_path_factory.mktemp("both"), STATED["both"])
    return out, analyze(out, resamples=RESAMPLES)


def test_each_session_and_side_has_the_estimates_of_a_study_of_its_own(halves, analysed):
    _, both = analysed
    for name, (session, side) in OF_HALF.items():
        own = analyze(halves / name, resamples=RESAMPLES)

        def mine(table, stated=(session, side)):
            own_rows = (table["session"] == stated[0]) & (table["side"] == stated[1])
            return table[own_rows].reset_index(drop=True)

        for frame in (StudyAnalysis.to_frame, StudyAnalysis.comparison_frame):
            pd.testing.assert_frame_equal(mine(frame(both))[VALUES], frame(own)[VALUES])
        assert len(mine(both.strides_frame())) == len(own.strides)
        found = next(p for p in both.log_posteriors if (p.session, p.side) == (session, side))
        assert found.mean.tolist() == own.log_posteriors[0].mean.tolist()


def test_every_table_of_rows_per_person_names_session_and_side(analysed):
    _, both = analysed
    for table in (
        both.to_frame(), both.comparison_frame(), both.pulses_frame(), both.strides_frame(),
        both.excluded_frame(), details_frame(both),
    ):  # fmt: skip
        assert list(table.columns[-2:]) == ["session", "side"]
        rows = set(zip(table["session"], table["side"], strict=True))
        assert table.empty or rows == set(OF_HALF.values())
    assert not both.to_frame().empty
    assert not both.to_frame().duplicated([*KEYS, "timing_point", "parameter"]).any()


def test_a_person_is_one_person_in_means(analysed):
    _, both = analysed
    people = {p.n_participants for p in both.population}
    assert max(people) == 2


def test_report_and_tables_hold_every_row(analysed):
    _, both = analysed
    labels = ["S01, day 1, left", "S01, day 2, right"]
    page = render_report(both, {}, title="both")
    table = paper_tables(both)["estimates"].to_frame()
    for label in labels:
        assert label in page
        assert (table.iloc[:, 0] == label).sum() == len({c.timing_point for c in both.cells})


def test_results_are_compared_and_explored_person_by_person(analysed, tmp_path):
    study, both = analysed
    write_results(both, tmp_path / "results", figures=False)
    made = compare_results([tmp_path / "results"])
    assert made.sources[0].participants == ("S01", "S02")
    estimates = both.to_frame()
    for value in made.values:  # noqa: PD011 - of a comparison, not a table
        rows = estimates[
            (estimates["participant"] == value.participant)
            & (estimates["timing_point"] == value.timing_point)
            & (estimates["parameter"] == value.parameter)
        ]
        if (rows["status"] == "undecided").any():
            assert value.status == "undecided"
        elif rows["value"].notna().any() and value.status != "mean_over_points":
            assert value.value == pytest.approx(rows["value"].mean())

    found = open_results(tmp_path / "results", study=study)
    assert found.labels == tuple(
        f"S0{k}, {', '.join(stated)}" for k in (1, 2) for stated in OF_HALF.values()
    )
    request = ReestimationRequest.of(found.analysed)
    again = reestimate(open_study(study), "S01", request)
    traces = read_traces(open_study(study), "S01", request, found.analysed)
    assert len(traces) == sum(p.participant == "S01" for p in both.pulses)
    now = with_new_estimates(found.analysed, open_study(study), {"S01": again})
    pd.testing.assert_frame_equal(now.to_frame(), both.to_frame())
    pd.testing.assert_frame_equal(now.population_frame(), both.population_frame())


def test_one_unperturbed_recording_without_session_serves_all(halves, tmp_path):
    out = joined(halves, tmp_path / "shared", STATED["sessions"])
    head, *entries = (out / "study.toml").read_text().split("[[recordings]]")
    level = [e for e in entries if '"unperturbed"' in e and "one/" in e]
    kept = [e.replace('session = "day 1"\n', "") for e in level]
    kept += [e for e in entries if '"perturbed"' in e]
    (out / "study.toml").write_text("[[recordings]]".join([head, *kept]))
    found = analyze(out, method="dissertation", resamples=2)
    assert set(found.to_frame()["session"]) == {"day 1", "day 2"}
    assert "ok" in set(found.to_frame().loc[found.to_frame()["session"] == "day 2", "status"])
    of_level = [s for s in found.strides if s.condition == "unperturbed"]
    assert len(of_level) == len(set(of_level))
    assert {s.session for s in of_level} == {""}


def test_the_other_side_teaches_nothing(halves, tmp_path):
    out = joined(halves, tmp_path / "other", STATED["sides"])
    head, *entries = (out / "study.toml").read_text().split("[[recordings]]")
    kept = [e for e in entries if not ('"unperturbed"' in e and '"right"' in e)]
    (out / "study.toml").write_text("[[recordings]]".join([head, *kept]))
    table = analyze(out, method="dissertation", resamples=2).to_frame()
    right = set(table.loc[table["side"] == "right", "status"])
    assert right == {"failed:no_unperturbed_recording"}
    assert "ok" in set(table.loc[table["side"] == "left", "status"])


def test_an_exclusion_holds_in_its_own_side_only(halves, tmp_path):
    out = joined(halves, tmp_path / "excluded", STATED["sides"])
    pulse = analyze(out, method="dissertation", resamples=2).pulses[0]
    row = f"{pulse.participant},{pulse.recording},{pulse.onset_s},exclude,odd,"
    (out / "exclusions.csv").write_text(
        f"participant,recording,onset_s,action,reason,time\n{row}\n"
    )
    left_out = [
        p for p in analyze(out, method="dissertation", resamples=2).pulses if p.code == "user"
    ]
    assert [(p.recording, p.side) for p in left_out] == [(pulse.recording, pulse.side)]


def test_names_that_would_be_those_of_two_rows_are_refused(halves, tmp_path):
    out = joined(halves, tmp_path / "names", {"one": 'side = "left"', "two": ""})
    text = (out / "study.toml").read_text()
    (out / "study.toml").write_text(text.replace('"S02"', '"S01, left"'))
    with pytest.raises(StudyError, match="S01, left"):
        open_study(out)
