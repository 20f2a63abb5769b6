"""Strides over the gait cycle, from a made-up walk whose angle is a function of phase."""

import numpy as np
import xarray as xr
from reproduction.chapter4.walking import (
    NODES,
    PersonGait,
    effect_figure,
    stride_curves,
    stride_figure,
)

from jointz.core.events import StrideRecord


def walk(lengths=(1.0, 1.2, 1.1, 1.05), rate_hz=200.0):
    """Return a recording whose angle is 0.5 - 0.4 cos(2 pi phase), and its strides."""
    starts = 0.5 + np.concatenate([[0.0], np.cumsum(lengths)])
    time = np.arange(0.0, starts[-1] + 0.5, 1.0 / rate_hz)
    phase = np.interp(time, starts, np.arange(starts.size))
    angle = 0.5 - 0.4 * np.cos(2 * np.pi * phase)
    recording = xr.Dataset({"angle": ("time", angle)}, coords={"time": time})
    strides = [
        StrideRecord("S01", "walk.nc", "unperturbed", float(start), length)
        for start, length in zip(starts, lengths, strict=False)
    ]
    return recording, strides


def test_strides_of_any_length_fall_on_the_same_curve():
    recording, strides = walk()
    curves = stride_curves(recording, recording["angle"].to_numpy(), strides)
    expected = 0.5 - 0.4 * np.cos(np.linspace(0.0, 2 * np.pi, NODES))
    assert curves.shape == (4, NODES)
    assert np.abs(curves[1:3] - expected).max() < 5e-3


def test_rejected_strides_are_left_out_and_missing_samples_bridged():
    recording, strides = walk()
    strides[1] = StrideRecord("S01", "walk.nc", "unperturbed", 1.5, 1.2, code="gap")
    angle = recording["angle"].to_numpy().copy()
    angle[450:453] = np.nan
    curves = stride_curves(recording, angle, strides)
    assert curves.shape == (3, NODES)
    assert np.isfinite(curves).all()


def test_without_an_accepted_stride_there_are_no_curves():
    recording, _ = walk()
    assert stride_curves(recording, recording["angle"].to_numpy(), []).shape == (0, NODES)
    nobody = {"S01": PersonGait(*(np.empty((0, NODES)) for _ in range(3)))}
    assert stride_figure(nobody, "S01") is None
    assert effect_figure(nobody, None) is None
