"""Missing samples and rows: what is interpolated, what stays, and what a result says of it."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.core.recording import build_recording
from jointz.identify.preparation.missing_samples import interpolate_missing, missing_notes

TIME_S = np.arange(2000) / 500.0


def recorded(kept=slice(None), **changes):
    channels = {
        "angle": np.sin(5.0 * TIME_S),
        "torque": np.cos(5.0 * TIME_S),
        "contact": TIME_S % 1.0 < 0.6,
    }
    channels = {n: v[kept] for n, v in (channels | changes).items()}
    return build_recording(TIME_S[kept], channels, condition="perturbed", file="walk.csv")


def test_a_complete_recording_is_left_alone():
    made = recorded()
    assert interpolate_missing(made, [1.0]) is made


def test_missing_rows_come_back_and_long_gaps_stay():
    kept = np.ones(TIME_S.size, dtype=bool)
    kept[[300, 700, 701, 1001]] = False
    kept[1500:1520] = False
    made = interpolate_missing(recorded(kept), [2.0])
    time = made["time"].to_numpy()

    # 2.002 s lies within 5 ms of the onset.
    assert np.setdiff1d(np.round(500.0 * TIME_S), np.round(500.0 * time)).tolist() == [
        1001,
        *range(1500, 1520),
    ]
    for name, course in (("angle", np.sin(5.0 * time)), ("torque", np.cos(5.0 * time))):
        assert made[name].to_numpy() == pytest.approx(course, abs=1e-6)
    np.testing.assert_array_equal(made["contact"], made["contact"].to_numpy() > 0)
    # Levels hold.
    assert made["contact"].to_numpy()[300] == made["contact"].to_numpy()[299]
    assert next(missing_notes("walk.csv", made)) == (
        "walk.csv: 0.15 % of the samples of angle (in 2 holes of at most 20 ms) are missing and "
        "were interpolated."
    )


def test_levels_and_holes_near_an_onset_are_not_filled():
    angle, contact = np.sin(5.0 * TIME_S), (TIME_S % 1.0 < 0.6).astype(float)
    angle[[498, 502, 800]] = contact[600] = np.nan
    made = interpolate_missing(recorded(angle=angle, contact=contact), [1.0])
    assert np.flatnonzero(np.isnan(made["angle"])).tolist() == [498, 502]
    assert np.isnan(made["contact"].to_numpy()[600])


def test_missing_samples_and_rows_cost_neither_estimates_nor_width(walkers):
    walker = walkers.Walker()
    whole = walkers.walk(walker)
    recording, rng = whole.recording.copy(deep=True), np.random.default_rng(1)
    n = recording.sizes["time"]
    for name in ("angle", "torque"):
        recording[name][rng.random(n) < 0.005] = np.nan
    recording = recording.isel(time=np.flatnonzero(rng.random(n) >= 0.005))
    clean, holed = (
        walkers.analyze(walker, one) for one in (whole, replace(whole, recording=recording))
    )

    compared = 0
    for one, other in zip(clean.cells["bayesian"], holed.cells["bayesian"], strict=True):
        for a, b in zip(one.parameters, other.parameters, strict=True):
            assert a.status == b.status
            if a.status == "ok":
                compared += 1
                assert b.value == pytest.approx(a.value, abs=0.25 * (a.ci_high - a.ci_low))
                assert b.ci_high - b.ci_low == pytest.approx(a.ci_high - a.ci_low, rel=0.2)
    assert compared >= 6
    assert sum("are missing and were interpolated" in note for note in holed.notes) == 2
    assert not any("missing" in note for note in clean.notes)
