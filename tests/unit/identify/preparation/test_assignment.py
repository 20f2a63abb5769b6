"""Which pulse belongs where, which are left out and why."""

import numpy as np
import pandas as pd
import pytest

from jointz.core.errors import DataError
from jointz.core.recording import build_recording
from jointz.core.study import CalibrationSpec, GroupSpec, PerturbationsSpec, UserExclusion
from jointz.identify.preparation.assignment import assign_pulses
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput, prepare_sources
from jointz.identify.study_kinds import BENCH, WALKING

RATE_HZ = 200.0
STRIDE_S = 1.0


def walk(onsets, *, n_strides=20, strikes=True, gap=(), names=None, longer=None, **attributes):
    """A walker with strikes at whole seconds, one stride may be longer, and a pulse table."""
    t = np.arange(int(n_strides * STRIDE_S * RATE_HZ)) / RATE_HZ
    channels = {"angle": np.sin(2 * np.pi * t), "torque": np.zeros(t.size), "position": t / 10.0}
    if strikes:
        strike_s = STRIDE_S * np.arange(n_strides)
        if longer is not None:
            strike_s[longer[0] + 1 :] += longer[1]
        since_s = t + 1e-9 - strike_s[np.searchsorted(strike_s, t + 1e-9) - 1]
        contact = (since_s < 0.6 * STRIDE_S).astype(float)
        for missing in gap:
            contact[(t >= missing - 0.4) & (t < missing + 0.6)] = 0.0
        channels["contact"] = contact
    given = build_recording(
        t,
        channels,
        **{"condition": "perturbed", "file": "walk.csv", "contact_kind": "contact", **attributes},
    )
    table = pd.DataFrame(
        {
            "onset_s": np.asarray(onsets, dtype=float),
            "duration_s": 0.25,
            "amplitude_nm": 17.0,
            "timing_point": names if names is not None else "",
        }
    )
    return RecordingInput(given, CalibrationSpec(), table)


def assigned(*given, walking=True, exclusions=(), group=None, baseline="unperturbed_mean", **more):
    settings = ParticipantSettings(
        kind=WALKING if walking else BENCH,
        perturbations=PerturbationsSpec(group=group, **more),
        group_edges=group.edges if group else (),
        methods=("dissertation",),
        n_resamples=10,
        user_exclusions=tuple(exclusions),
    )
    sources = prepare_sources(given, settings)
    return assign_pulses("S01", sources, settings, baseline=baseline)


def codes(found):
    return [c.record.code for c in found]


def labels(found):
    return [c.record.timing_point for c in found]


def test_a_pulse_takes_the_nearest_timing_point_on_the_circle():
    points = {"ICO": 1.0, "MST": 21.5, "TSW": 93.5}
    onsets = [6.02, 7.99, 9.16, 11.90, 13.02, 15.20, 17.94]
    found = assigned(walk(onsets), timing_points=points)

    assert labels(found) == ["ICO", "ICO", "MST", "TSW", "ICO", "MST", "TSW"]
    np.testing.assert_allclose(
        [c.record.measured_pct for c in found], [2, 99, 16, 90, 2, 20, 94], atol=0.6
    )
    assert [c.record.target_pct for c in found][:3] == [1.0, 1.0, 21.5]
    np.testing.assert_allclose([c.elapsed_s for c in found][2:4], [0.16, 0.9], atol=0.006)
    assert codes(found) == [""] * 7


def test_the_measured_phase_is_that_of_the_stride_as_it_happened():
    points = {"LRE": 7.0, "MST": 38.0, "TST": 44.0}
    found = assigned(walk([10.44, 19.17], longer=(10, 0.1)), timing_points=points)

    # Strides of 1 s predict 44 %; the stride lasted 1.1 s.
    assert labels(found) == ["TST", "LRE"]
    assert found[0].record.measured_pct == pytest.approx(40.0, abs=0.6)
    assert found[1].record.measured_pct is None  # no heel strike ends the last stride


SIX = {"LRE": 7.0, "MST": 21.5, "TST": 40.5, "PSW": 56.0, "ISW": 68.5, "MSW": 81.0}


def test_a_name_in_the_table_stands_and_the_measured_phase_beside_it():
    found = assigned(walk([6.16, 9.16], names=["LRE", "LRE"]))

    # 16 % is nearer to MST.
    assert labels(found) == ["LRE", "LRE"]
    assert codes(found) == ["", ""]
    assert [c.record.target_pct for c in found] == [7.0, 7.0]
    np.testing.assert_allclose([c.record.measured_pct for c in found], 16.0, atol=0.6)


def test_a_name_that_the_measured_phase_contradicts_excludes_its_pulse():
    onsets = [4.07, 5.99, 8.40, 10.07, 12.07, 14.07]
    found = assigned(walk(onsets, names=["LRE"] * 6))

    contradicted = "label_contradicts_phase"
    assert codes(found) == ["", "", contradicted, "", "", ""]
    assert found[2].record.timing_point == "LRE"


def test_the_predicted_phase_contradicts_where_no_stride_gives_a_measured_one():
    found = assigned(walk([6.07, 9.07, 19.40, 12.07], names=["LRE"] * 4))
    assert codes(found) == ["", "", "", "label_contradicts_phase"]


def planned(*, labels_of=None, n=18):
    """Return onsets at the six timing points in turn, and their names or other ones."""
    points = list(SIX) * (n // 6)
    onsets = [4.0 + 2 * k + SIX[p] / 100 for k, p in enumerate(points)]
    return onsets, points if labels_of is None else labels_of(points)


@pytest.mark.parametrize(
    "labels_of",
    [lambda n: [n[-1], *n[:-1]], lambda n: [*n[1:], n[0]], lambda n: n[::-1]],
    ids=["earlier", "later", "other trial"],
)
def test_many_contradicted_names_stop_the_analysis(labels_of):
    onsets, names = planned(labels_of=labels_of)
    with pytest.raises(DataError, match=r"walk\.csv: 1\d of 18 pulses.* 4\.07 s"):
        assigned(walk(onsets, names=names, n_strides=45))


def test_names_are_not_asked_of_phases_that_the_study_does_not_have():
    onsets, names = planned(labels_of=lambda names: names[::-1])
    own = [f"point {name}" for name in names]
    assert set(codes(assigned(walk(onsets, names=own, n_strides=45)))) == {""}
    silent = assigned(walk(onsets, names=names, n_strides=45, strikes=False))
    assert set(codes(silent)) == {""}
    bench = assigned(walk(onsets, names=names, n_strides=45), walking=False)
    assert set(codes(bench)) == {""}


def test_contradicted_pulses_that_the_user_left_out_stop_nothing():
    onsets = [4.40, 6.40, 8.40, 10.07, 12.07]
    lines = [UserExclusion("S01", "walk.csv", t, "exclude", "") for t in onsets[:3]]
    found = assigned(walk(onsets, names=["LRE"] * 5), exclusions=lines)
    assert codes(found) == ["user"] * 3 + [""] * 2


def test_a_missing_strike_excludes_but_counts_the_pulse():
    found = assigned(walk([6.07, 10.5, 14.07], gap=[10.0]))
    assert codes(found) == ["", "missing_strike", ""]
    assert labels(found)[1] != ""


def test_what_asks_nothing_of_the_gait_is_used_without_a_phase():
    onsets, names = [1.07, 2.07, 10.5, 14.07], ["LRE"] * 4
    found = assigned(walk(onsets, gap=[10.0], names=names), baseline="pre_pulse")

    assert codes(found) == [""] * 4
    # The stride around the third has no end; the others are known although none was predicted.
    assert found[2].record.measured_pct is None
    others = [c.record.measured_pct for c in found if c.record.measured_pct is not None]
    assert others == pytest.approx([7.0] * 3, abs=0.6)
    by_channel = GroupSpec(channel="position", edges=(0.0, 2.0))
    assert codes(assigned(walk(onsets), group=by_channel, baseline="pre_pulse")) == [""] * 4


@pytest.mark.parametrize("baseline", ["unperturbed_mean", "matched_strides"])
def test_a_baseline_of_strides_asks_for_the_phase_of_a_named_pulse(baseline):
    found = assigned(walk([1.07, 9.07, 12.07], names=["LRE"] * 3), baseline=baseline)
    assert codes(found) == ["no_recent_strides", "", ""]


def test_a_pulse_outside_the_recording_is_counted_where_it_is_named():
    found = assigned(walk([-3.0, 6.07, 9.07, 31.0], names=["LRE"] * 4))

    assert codes(found) == ["edge_of_record", "", "", "edge_of_record"]
    assert labels(found) == ["LRE"] * 4
    assert found[3].record.measured_pct is None


def test_pulses_that_meet_each_other_are_excluded():
    table = walk([6.07, 6.12, 9.07, 9.22, 12.07, 15.07])
    found = assigned(table, timing_points={"LRE": 7.0})

    # 6.12 begins in the window and in the pulse of 6.07; 9.22 in the pulse of 9.07 alone.
    assert codes(found) == ["overlapping_pulse"] * 2 + ["", "overlapping_pulse"] + [""] * 2


def test_a_pulse_inside_a_long_one_is_excluded_behind_a_short_one_too():
    table = walk([6.07, 6.5, 6.9, 9.07, 12.07])
    table.pulse_table["duration_s"] = [1.0, 0.05, 0.25, 0.25, 0.25]
    found = assigned(table, timing_points={"LRE": 7.0})

    assert codes(found) == ["", "overlapping_pulse", "overlapping_pulse", "", ""]


def test_a_pulse_left_alone_by_the_exclusion_of_others_is_lone():
    excluded = UserExclusion("S01", "walk.csv", 6.07, "exclude", "")
    found = assigned(walk([6.07, 9.07]), exclusions=[excluded])
    assert codes(found) == ["user", "lone_pulse"]


@pytest.mark.parametrize(
    ("actions", "left_out"),
    [(["exclude"], True), (["exclude", "restore"], False), (["restore", "exclude"], True)],
)
def test_the_last_line_of_the_user_wins(actions, left_out):
    lines = [UserExclusion("S01", "walk.csv", 9.0705, a, "") for a in actions]
    found = assigned(walk([6.07, 9.07, 12.07]), exclusions=lines)
    assert codes(found) == ["", "user" if left_out else "", ""]


def test_a_line_about_another_file_or_moment_changes_nothing():
    lines = [
        UserExclusion("S01", "other.csv", 9.07, "exclude", ""),
        UserExclusion("S01", "walk.csv", 9.08, "exclude", ""),
    ]
    assert codes(assigned(walk([6.07, 9.07, 12.07]), exclusions=lines)) == [""] * 3


def test_the_users_reason_stands_beside_the_code():
    lines = [
        UserExclusion("S01", "walk.csv", 9.07, "exclude", "looked odd"),
        UserExclusion("S01", "walk.csv", 9.07, "exclude", "a hand hit the sensor"),
        UserExclusion("S01", "walk.csv", 12.07, "exclude", "stumbled"),
        UserExclusion("S01", "walk.csv", 12.07, "restore", "did not"),
    ]
    found = assigned(walk([6.07, 9.07, 12.07]), exclusions=lines)
    assert [c.record.detail for c in found] == ["", "a hand hit the sensor", ""]


def test_a_pulse_at_the_edge_of_the_record_is_excluded():
    found = assigned(walk([6.07, 9.07, 19.9]))
    assert codes(found) == ["", "", "edge_of_record"]


def test_groups_are_told_by_the_channel_at_the_onset():
    group = GroupSpec(channel="position", edges=(0.5, 1.0, 1.5))
    found = assigned(walk([6.0, 7.0, 11.0, 12.0, 2.0, 16.0]), walking=False, group=group)

    by_onset = {c.record.onset_s: (c.record.timing_point, c.record.code) for c in found}
    assert by_onset[6.0] == by_onset[7.0] == ("0.5..1", "")
    assert by_onset[11.0] == by_onset[12.0] == ("1..1.5", "")
    assert by_onset[16.0] == ("", "outside_groups")
    assert by_onset[2.0][0] == ""
    assert {c.record.target_pct for c in found} == {None}


def test_a_group_channel_without_a_number_is_outside_all_groups():
    given = walk([6.0, 7.0, 8.0])
    position = given.recording["position"].to_numpy().copy()
    position[1395:1405] = np.nan
    spoilt = given.recording.assign(position=("time", position, {"units": "1"}))
    spoilt = RecordingInput(spoilt, given.calibration, given.pulse_table)
    group = GroupSpec(channel="position", edges=(0.5, 1.0))

    assert codes(assigned(spoilt, walking=False, group=group)) == ["", "outside_groups", ""]


@pytest.mark.parametrize(
    ("attributes", "label"),
    [
        ({"trial": "A3"}, "A3"),
        ({"session": "1A"}, "1A"),
        ({"trial": "A3", "session": "1A"}, "1A"),
        ({}, "all_pulses"),
    ],
)
def test_on_a_bench_the_trial_or_case_is_the_label(attributes, label):
    found = assigned(walk([2.0, 3.0], strikes=False, **attributes), walking=False)

    assert labels(found) == [label] * 2
    assert codes(found) == [""] * 2
    assert [c.elapsed_s for c in found] == [2.0, 3.0]
    assert {c.record.measured_pct for c in found} == {None}


@pytest.mark.parametrize("attributes", [{"trial": "all"}, {"session": "all"}, {"names": "all"}])
def test_no_case_has_the_name_of_all_of_them(attributes):
    with pytest.raises(DataError, match=r"walk\.csv: "):
        assigned(walk([2.0, 3.0], strikes=False, **attributes), walking=False)


def test_walking_without_strikes_and_without_names_says_so():
    for strikes, gap in ((False, ()), (True, range(21))):
        found = assigned(walk([6.0, 9.0], strikes=strikes, gap=gap))
        assert set(codes(found)) == {"no_heel_strikes"}


def test_walking_without_a_contact_channel_trusts_the_names_of_the_table():
    found = assigned(walk([6.0, 9.0], strikes=False, names=["LRE", "LRE"]))
    assert labels(found) == ["LRE", "LRE"]
    assert codes(found) == ["", ""]
    assert np.isnan([c.elapsed_s for c in found]).all()


def test_an_amplitude_that_the_table_does_not_give_is_measured_and_a_length_stays_unknown():
    given = walk([6.07, 9.07])
    table = given.pulse_table.assign(duration_s=np.nan, amplitude_nm=np.nan)
    found = assigned(RecordingInput(given.recording, given.calibration, table))
    assert [c.record.duration_s for c in found] == [None] * 2
    assert all(c.record.amplitude is not None for c in found)
