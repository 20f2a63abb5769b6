"""Recordings made ready: torque, strides, pulses, and what is refused."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jointz.core.errors import DataError
from jointz.core.recording import build_recording
from jointz.core.study import (
    Calibrated,
    CalibrationSpec,
    PerturbationsSpec,
    TorqueModelSpec,
    UserExclusion,
)
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    most_alike,
    prepare_sources,
)
from jointz.identify.study_kinds import BENCH, WALKING

MODEL = TorqueModelSpec(gear_ratio=9.0, torque_constant=0.1)


def settings(*, torque_model=None, exclusions=(), walking=True, **more):
    return ParticipantSettings(
        kind=WALKING if walking else BENCH,
        perturbations=PerturbationsSpec(**more),
        torque_model=torque_model,
        methods=("dissertation",),
        n_resamples=10,
        user_exclusions=tuple(exclusions),
    )


def record(condition="perturbed", *, rate_hz=200.0, pulses=(), drop=(), table=None, **attributes):
    t = np.arange(int(20 * rate_hz)) / rate_hz
    per_stride = int(rate_hz)
    channels = {
        "angle": np.sin(2 * np.pi * t),
        "torque": np.zeros(t.size),
        "command": sum((17.0 * ((t >= p) & (t < p + 0.2)) for p in pulses), np.zeros(t.size)),
        "contact": np.arange(t.size) % per_stride < 0.6 * per_stride,
        "current": np.ones(t.size),
        "reference": np.sin(t) + sum((1.0 * ((t >= p) & (t < p + 0.2)) for p in pulses), 0 * t),
    }
    kept = {k: v for k, v in channels.items() if k not in drop}
    attributes = {"file": f"{condition}.csv", "contact_kind": "contact", **attributes}
    made = build_recording(t, kept, condition=condition, **attributes)
    return RecordingInput(made, CalibrationSpec(), table)


def table_of(*onsets):
    return pd.DataFrame(
        {"onset_s": onsets, "duration_s": 0.2, "amplitude_nm": 17.0, "timing_point": ""}
    )


def onsets(source):
    return [p.onset_s for p in source.pulses]


def test_all_recordings_come_to_the_rate_of_the_perturbed_one():
    sources = prepare_sources(
        [record("unperturbed", rate_hz=400.0), record("perturbed", rate_hz=200.0)], settings()
    )

    assert [s.input.condition for s in sources] == ["perturbed", "unperturbed"]
    assert [s.signals.rate_hz for s in sources] == pytest.approx([200.0, 200.0])


@pytest.mark.parametrize("source", [None, "trigger"])
def test_pulses_come_from_a_trigger_in_both_conditions(source):
    at = [3.0, 7.5, 12.0, 16.0]
    recordings = []
    for condition in ("unperturbed", "perturbed"):
        made = record(condition, pulses=at, drop=["reference"])
        command = made.recording["command"].to_numpy()
        channels = {"trigger": ("time", 5.0 * (command > 0)), "torque": ("time", -command)}
        trigger = made.recording.assign(channels).drop_vars("command")
        recordings.append(replace(made, recording=trigger))

    perturbed, unperturbed = prepare_sources(recordings[::-1], settings(source=source))

    assert onsets(perturbed) == onsets(unperturbed) == at
    assert [p.amplitude for p in perturbed.pulses] == pytest.approx([-17.0] * 4)
    assert np.isnan([p.amplitude for p in unperturbed.pulses]).all()


def test_torque_comes_from_current_where_it_was_not_measured():
    (source,) = prepare_sources([record(drop=["torque"])], settings(torque_model=MODEL))
    assert source.input.recording["torque"].attrs["units"] == "N*m"
    np.testing.assert_allclose(source.input.recording["torque"], 0.9)


@pytest.mark.parametrize("drop", [["torque"], ["torque", "current"]])
def test_a_recording_without_any_torque_is_refused(drop):
    model = MODEL if "current" in drop else None
    with pytest.raises(DataError, match=r"perturbed.csv: .*channels.torque"):
        prepare_sources([record(drop=drop)], settings(torque_model=model))


def test_without_a_device_neither_torque_nor_pulses_are_expected():
    (source,) = prepare_sources([record("no_device", drop=["torque", "command"])], settings())
    assert source.pulses == ()
    assert source.strides is not None


def test_a_table_goes_before_the_command_and_the_command_before_the_reference():
    given = record(pulses=[5.0])
    with_table = replace(given, pulse_table=table_of(6.0, 7.0))
    only_reference = record(pulses=[5.0], drop=["command"])
    plain = record("unperturbed", drop=["command"])

    assert onsets(prepare_sources([with_table], settings())[0]) == [6.0, 7.0]
    assert onsets(prepare_sources([given], settings())[0]) == [5.0]
    assert onsets(prepare_sources([only_reference, plain], settings())[0]) == [5.0]


def test_the_study_may_name_another_source():
    given = replace(record(pulses=[5.0]), pulse_table=table_of(6.0))
    assert onsets(prepare_sources([given], settings(source="command"))[0]) == [5.0]
    assert onsets(prepare_sources([given], settings(source="table"))[0]) == [6.0]


def with_steps(given, moments_s, sizes_rad):
    t = given.recording["time"].to_numpy()
    steps = [
        size * np.clip((t - moment) / 0.02, 0, 1)
        for moment, size in zip(moments_s, sizes_rad, strict=True)
    ]
    stepped = given.recording["angle"].copy(data=np.sum(steps, axis=0))
    return replace(given, recording=given.recording.assign(angle=stepped))


def test_steps_of_the_angle_are_those_of_a_platform_many_and_alike():
    given, moments_s = record(pulses=[5.0]), 4.0 + 0.6 * np.arange(12)
    platform = with_steps(given, moments_s, np.full(12, 0.05))
    found = onsets(prepare_sources([platform], settings(source="angle"))[0])
    np.testing.assert_allclose(found, moments_s, atol=0.02)
    for few_or_unlike in (([8.0, 9.0], [0.05, 0.05]), (moments_s, 0.05 * 1.3 ** np.arange(12))):
        with pytest.raises(DataError, match=r"or more alike, found \d+, such as at .* deg\)"):
            prepare_sources([with_steps(given, *few_or_unlike)], settings(source="angle"))


def test_a_source_that_is_not_there_is_refused():
    with pytest.raises(DataError, match="table"):
        prepare_sources([record()], settings(source="table"))
    with pytest.raises(DataError, match="unperturbed recording"):
        prepare_sources([record(drop=["command"])], settings())


def test_a_timing_point_that_the_study_does_not_have_is_refused():
    given = replace(record(), pulse_table=table_of(6.0).assign(timing_point="LRRE"))
    with pytest.raises(DataError, match="LRRE"):
        prepare_sources([given], settings(timing_points={"LRE": 7.0}))


def test_the_reference_is_compared_with_the_same_trial():
    a = record("unperturbed", drop=["command"], trial="A", pulses=[3.0])
    b = record("unperturbed", drop=["command"], trial="B")
    perturbed = record(drop=["command"], trial="B", pulses=[5.0])

    sources = prepare_sources([a, perturbed, b], settings(walking=False))

    assert onsets(sources[0]) == [5.0]


def test_most_alike_puts_earlier_keys_before_later_ones():
    def of(**attributes):
        return record("unperturbed", **attributes)

    given = record(session="1", trial="A")
    same_session, same_trial = of(session="1", trial="B"), of(session="2", trial="A")
    keys = ("session", "side", "trial")

    assert most_alike(given, [same_trial, same_session], keys=keys) == [same_session]
    both = of(session="1", trial="A")
    assert most_alike(given, [same_session, both], keys=keys) == [both]
    stranger = of(session="3", trial="C")
    assert most_alike(given, [stranger, stranger], keys=keys) == [stranger] * 2
    assert most_alike(given, [], keys=keys) == []


def test_strides_with_a_pulse_or_left_out_by_the_user_are_disturbed():
    line = UserExclusion("S01", "unperturbed.csv", 9.0, "exclude", "")
    given = record("unperturbed", pulses=[5.3])
    (source,) = prepare_sources([given], settings(exclusions=[line]))

    disturbed = source.strides.start_s[~source.undisturbed]
    np.testing.assert_allclose(disturbed, [5.0, 9.0])


def test_the_angle_is_counted_from_the_joints_true_zero():
    given = record(pulses=[7.0])
    known = CalibrationSpec(angle_zero_rad=Calibrated(value=0.3, sd=0.01))
    told, plain = (
        prepare_sources([replace(given, calibration=c)], settings())[0]
        for c in (known, CalibrationSpec())
    )
    turned, shown = told.input.recording["angle"], plain.input.recording["angle"]
    np.testing.assert_allclose(turned, shown - 0.3, atol=1e-15)
    assert turned.attrs == shown.attrs
    for mine, other in zip(told.signals.stretches, plain.signals.stretches, strict=True):
        np.testing.assert_allclose(mine.signals[0], other.signals[0] - 0.3, atol=1e-9)
        np.testing.assert_allclose(mine.signals[1:], other.signals[1:], atol=1e-6)


def test_calibrated_levels_find_the_strikes_of_a_switch_that_gives_volts():
    t = np.arange(4000) / 200.0
    on = np.arange(t.size) % 200 < 120
    # A quarter of the strides only brush the switch: found in the record, its levels differ.
    volts = 0.2 + np.where(np.arange(t.size) // 200 % 4 == 3, 0.5, 2.6) * on
    made = build_recording(
        t,
        {"angle": np.sin(t), "torque": 0.0 * t, "command": 0.0 * t, "contact": volts},
        condition="perturbed",
        contact_kind="voltage",
    )
    found = {}
    for threshold in (0.5, 1.5):
        known = CalibrationSpec(
            contact_threshold_v=Calibrated(value=threshold, sd=0.05),
            contact_release_v=Calibrated(value=threshold - 0.1, sd=0.05),
        )
        strides = prepare_sources([RecordingInput(made, known)], settings())[0].strides
        found[threshold] = strides.start_s.size
    assert found[0.5] == 18
    assert found[1.5] < 15
