"""The specification curve of a study's participant."""

import pytest

from jointz.analysis.analyze import analyze
from jointz.analysis.specification_job import specification_curve

from .studies import without_recordings


@pytest.fixture(scope="module")
def curve(small_study_source):
    return specification_curve(
        small_study_source,
        participant="S02",
        windows_s=(0.08, 0.1),
        cutoffs_hz=(20.0,),
        resamples=20,
    )


def test_every_set_of_choices_is_there(curve):
    table = curve.to_frame()
    sets = table.drop_duplicates(["method", "baseline", "window_s", "cutoff_hz", "inertia_model"])[
        "method"
    ].value_counts()

    assert sets["rigid"] == 3 * 2 * 3  # baselines, windows, models of the inertia
    assert sets["dissertation"] == 2 * 2  # baselines, windows
    assert curve.timing_points == ("LRE", "MST", "TST", "PSW", "ISW", "MSW")


def test_the_studys_own_choice_is_one_of_them(curve, small_study_source):
    """Window 0.1 s, predicted baseline, pooled inertia: as analyze has it."""
    own = {
        (c.timing_point, p.name): (p.status, p.value, p.ci_low, p.ci_high)
        for c in analyze(small_study_source, resamples=20).cells
        for p in c.parameters
        if c.participant == "S02"
    }
    rows = [
        e
        for e in curve.estimates
        if (e.method, e.baseline, e.window_s, e.inertia_model)
        == ("rigid", "predicted", 0.1, "pooled")
    ]

    assert len(rows) == 18
    for row in rows:
        found = (row.status, row.value, row.ci_low, row.ci_high)
        assert found == own[row.timing_point, row.parameter]


def test_a_window_that_is_refused_takes_no_other_with_it(small_study_source):
    table = specification_curve(
        small_study_source, windows_s=(0.1, 0.2), cutoffs_hz=(20.0,), resamples=20
    ).to_frame()
    counts = table.groupby(["method", "window_s"])["status"].agg(["size", set])

    assert counts.loc[("rigid", 0.2), "set"] == {"failed:window_too_long"}
    assert counts.loc[("rigid", 0.1), "size"] == 3 * 3 * 18
    assert "ok" in counts.loc[("rigid", 0.1), "set"]
    assert "ok" in counts.loc[("dissertation", 0.2), "set"]


def test_a_participant_without_pulses_has_rows_that_say_so(small_study):
    without_recordings(small_study, "S02", "perturbed")

    table = specification_curve(small_study.root, participant="S02", resamples=20).to_frame()

    assert set(table["status"]) == {"failed:no_perturbed_recording"}
    assert set(table["timing_point"]) == {"LRE", "MST", "TST", "PSW", "ISW", "MSW"}
    assert len(table) == 18 * (3 * 5 * 3 + 2 * 5 * 3)


def test_a_baseline_without_strides_has_rows_that_say_so(small_study):
    without_recordings(small_study, "S02", "unperturbed")

    table = specification_curve(
        small_study.root, participant="S02", windows_s=(0.1,), cutoffs_hz=(20.0,), resamples=20
    ).to_frame()

    of_mean = table[table["baseline"] == "unperturbed_mean"]
    assert len(of_mean) == 18 * (3 + 1)
    assert set(of_mean[of_mean["method"] == "dissertation"]["status"]) == {
        "failed:no_unperturbed_recording"
    }
    assert of_mean["status"].str.startswith("failed:").all()


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"participant": "S99"}, "participant: expected one of S01, S02; got 'S99'"),
        ({"windows_s": ()}, "windows_s: expected one or more positive numbers"),
        ({"cutoffs_hz": (-1.0,)}, "cutoffs_hz: expected one or more positive numbers"),
        ({"baselines": ("pre_pulse",)}, "baselines: expected one or more names among predicted"),
    ],
)
def test_choices_that_make_no_sense_are_refused(small_study_source, asked, message):
    with pytest.raises(ValueError, match=message):
        specification_curve(small_study_source, **asked)


@pytest.fixture(scope="module")
def strapped(small_study_source):
    return specification_curve(
        small_study_source,
        method="strapped",
        windows_s=(0.1, 0.15),
        assumptions=("standard", "no_reflex", "no_drift"),
        resamples=20,
    )


def test_strapped_is_varied_in_its_own_assumptions(strapped):
    table = strapped.to_frame()
    sets = table.drop_duplicates(["method", "window_s", "assumption"])

    assert sets["method"].value_counts().to_dict() == {"strapped": 2 * 3, "rigid": 1}
    assert strapped.settings["assumptions"] == ["standard", "no_reflex", "no_drift"]
    assert strapped.plot(parameter="inertia").get_ylabel().startswith("inertia")


def test_a_window_of_the_strapped_curve_is_what_analyze_gives(strapped, small_study_source):
    """All windows share one fit; each is as if it were the only one."""
    own = {
        (c.timing_point, p.name): (p.status, p.value, p.ci_low, p.ci_high)
        for c in analyze(small_study_source, method="strapped", resamples=20).cells
        for p in c.parameters
        if c.participant == strapped.participant
    }
    rows = [e for e in strapped.estimates if (e.assumption, e.window_s) == ("standard", 0.1)]

    assert len(rows) == 18
    for row in rows:
        found = (row.status, row.value, row.ci_low, row.ci_high)
        assert found == own[row.timing_point, row.parameter]


def test_a_choice_that_the_method_does_not_have_is_refused(small_study_source):
    with pytest.raises(ValueError, match=r'cutoffs_hz: the method strapped .* method="rigid"'):
        specification_curve(small_study_source, method="strapped", cutoffs_hz=(20.0,))
    with pytest.raises(ValueError, match=r'assumptions: the method rigid .* method="strapped"'):
        specification_curve(small_study_source, method="rigid", assumptions=("no_reflex",))
    with pytest.raises(ValueError, match="assumptions: expected one or more names among standard"):
        specification_curve(small_study_source, method="strapped", assumptions=("no_leg",))
    with pytest.raises(ValueError, match="method: expected recommended, strapped or rigid"):
        specification_curve(small_study_source, method="dissertation")
