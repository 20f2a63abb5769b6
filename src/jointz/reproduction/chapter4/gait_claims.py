"""Unperturbed gait of chapter IV: strides over the cycle, and whether the device changes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians
from typing import Any

import numpy as np
import xarray as xr

from jointz.core.events import StrideRecord
from jointz.core.study import RecordingSpec, Study
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.io.recordings import read_recording
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.reference import chapter4
from jointz.results.statistics.waveform_test import WaveformTest
from jointz.stats.sign_flip import sign_flip_max_t
from jointz.stats.spm import spm_paired_t

#: Nodes of a cycle, 0 and 100 % included: as spm1d's users have them.
NODES = 101
#: Of position and torque (4.2.2).
CUTOFF_HZ = 20.0
#: Differences of a joint's angle below this are commonly held to be of no importance in gait
#: analysis (McGinley et al. 2009, doi:10.1016/j.gaitpost.2008.09.003).
MARGIN_RAD = radians(5.0)
#: People below which curves cannot be compared.
_FEWEST_PEOPLE = 3
_DIGITS = 5


@dataclass(frozen=True, slots=True, eq=False)
class PersonGait:
    """Unperturbed strides of a person."""

    # angle over the gait cycle without and with the device (NWC and ENP); no rows where the
    # condition was not recorded
    no_device: np.ndarray
    device: np.ndarray
    # of the device on the joint while it should be zero, by its current; rows as ``device``
    torque: np.ndarray


def people_gait(study: Study, strides: Sequence[StrideRecord]) -> dict[str, PersonGait]:
    """Return the unperturbed strides of every person of a study."""
    return {person.id: _person(study, person.id, strides) for person in study.spec.participants}


def _person(study: Study, person: str, strides: Sequence[StrideRecord]) -> PersonGait:
    none = np.empty((0, NODES))
    angles, torques = {"no_device": none, "unperturbed": none}, none
    for entry in study.spec.recordings:
        if entry.participant != person or entry.condition not in angles:
            continue
        own = [s for s in strides if s.recording == entry.file and s.participant == person]
        recording = _read(study, entry)
        angles[entry.condition] = stride_curves(recording, recording["angle"].to_numpy(), own)
        if entry.condition == "unperturbed" and study.spec.torque_model is not None:
            torque, _ = torque_from_current(recording, study.spec.torque_model, cutoff_hz=CUTOFF_HZ)
            torques = stride_curves(recording, torque, own)
    return PersonGait(angles["no_device"], angles["unperturbed"], torques)


def _read(study: Study, entry: RecordingSpec) -> xr.Dataset:
    (recording,) = read_recording(study, entry)  # a simulated study has one trial a file
    return recording


def stride_curves(
    recording: xr.Dataset, values: np.ndarray, strides: Sequence[StrideRecord]
) -> np.ndarray:
    """Return a signal over the gait cycle, one row an accepted stride."""
    time = recording["time"].to_numpy()
    known = np.isfinite(values)
    step = float(np.median(np.diff(time)))
    even = np.arange(time[0], time[-1] + 0.5 * step, step)
    whole = np.interp(even, time[known], values[known])
    smooth = lowpass_zero_phase(whole, cutoff_hz=CUTOFF_HZ, rate_hz=1.0 / step)
    share = np.linspace(0.0, 1.0, NODES)
    kept = [s for s in strides if not s.code]
    rows = [np.interp(s.start_s + share * s.duration_s, even, smooth) for s in kept]
    return np.array(rows) if rows else np.empty((0, NODES))


def device_effect(gait: Mapping[str, PersonGait]) -> tuple[WaveformTest, WaveformTest] | None:
    """Compare the mean angle without and with the device, one pair of curves a person."""
    both = [g for g in gait.values() if len(g.no_device) and len(g.device)]
    if len(both) < _FEWEST_PEOPLE:
        return None
    without = np.array([g.no_device.mean(axis=0) for g in both])
    with_it = np.array([g.device.mean(axis=0) for g in both])
    return (
        spm_paired_t(without, with_it, equivalence_margin=MARGIN_RAD),
        sign_flip_max_t(without, with_it, equivalence_margin=MARGIN_RAD),
    )


def stride_figure(gait: Mapping[str, PersonGait], person: str) -> dict[str, Any] | None:
    """Return what figure 4.2 draws; None where the person did not walk unperturbed."""
    shown = gait[person]
    if not len(shown.device):
        return None
    return {
        "person": person,
        "gait_pct": np.linspace(0.0, 100.0, NODES).tolist(),
        "angle_rad": shown.device.round(_DIGITS).tolist(),
        "torque_nm": shown.torque.round(_DIGITS).tolist(),
    }


def effect_figure(
    gait: Mapping[str, PersonGait], tests: tuple[WaveformTest, WaveformTest] | None
) -> dict[str, Any] | None:
    """Return what figure 4.3 draws; None without tests."""
    if tests is None:
        return None
    field, flips = tests
    both = [g for g in gait.values() if len(g.no_device) and len(g.device)]
    return {
        "gait_pct": np.linspace(0.0, 100.0, NODES).tolist(),
        "t": list(field.t),
        "threshold": field.threshold,
        "flip_threshold": flips.threshold,
        "printed_threshold": chapter4.SPM_THRESHOLD.value,
        "no_device_rad": np.mean([g.no_device.mean(axis=0) for g in both], axis=0).tolist(),
        "device_rad": np.mean([g.device.mean(axis=0) for g in both], axis=0).tolist(),
        "difference_rad": list(field.difference),
        "low_rad": list(field.ci_low),
        "high_rad": list(field.ci_high),
        "margin_rad": MARGIN_RAD,
        "n_people": field.n_a,
    }
