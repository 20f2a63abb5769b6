"""Checks of a recording's sampling rate against strides and pulses."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.channels import HEEL_STRIKES
from jointz.core.errors import DataError
from jointz.core.events import StrideRecord
from jointz.core.grouping import by_key
from jointz.core.study import RecordingSpec, Study
from jointz.gait.heel_strikes import find_heel_strikes
from jointz.gait.pulse_lengths import rate_of_lengths
from jointz.gait.sample_rate import (
    LONGEST_S,
    SHORTEST_S,
    USUAL_HZ,
    format_rates,
    is_walking_stride,
    median_stride_s,
    rates_of_strides,
    scale_of_onsets,
    usual_strides_s,
)
from jointz.gait.strides import find_strides
from jointz.gait.timestamps import rate_hz

_MOST_BEYOND = 0.2  # share of onsets that may be beyond the end of a recording
#: Most of stance, in which no knee flexes most, % of the cycle.
_STANCE_PCT = (8.0, 45.0)
_EXPECTED = f"people walk with {SHORTEST_S:g} to {LONGEST_S:g} s"


def check_strides(study: Study, entry: RecordingSpec, pieces: Sequence[xr.Dataset]) -> None:
    """Refuse a sampling rate of the study that gives unusual stride times.

    A wrong rate scales K, B and J without any sign in the fit, and no data confirm a rate that
    only the study states; so the analysis stops and asks. Time stamps of the recorder are data,
    for which ``stride_warnings`` only warns.
    """
    longest = max(pieces, key=lambda piece: piece.sizes["time"])
    if study.spec.kind == "walking" and HEEL_STRIKES in longest:
        check_listed_strikes(entry.heel_strikes or entry.file, longest)
    if study.spec.kind != "walking" or _is_stamped(study):
        return
    stride = median_stride_s(longest)
    shortest, most = usual_strides_s(study.spec.participant(entry.participant).height_m)
    if stride is None or shortest <= stride <= most:
        return
    likely = format_rates(rates_of_strides(longest))
    raise DataError(
        f"{entry.file}: its strides last {stride:.3g} s (median) at sample_rate_hz = "
        f"{study.spec.sample_rate_hz:g}; usual are {shortest:.2g} to {most:.2g} s. "
        f"{f'Likely rate: {likely}. ' if likely else ''}Correct sample_rate_hz. If it is right, as "
        "for slow walking, give the recorder's time stamps instead: [channels.time]; for children, "
        "give height_m.",
        path=entry.file,
    )


def check_listed_strikes(file: str, recording: xr.Dataset) -> None:
    """Refuse listed heel strikes that are those of both legs, or of the other leg.

    A knee flexes most in swing, at about 72 % of the cycle from its own heel strike.
    """
    stride = median_stride_s(recording)
    if stride is not None and stride < SHORTEST_S:
        raise DataError(
            f"{file}: its heel strikes are {stride:.3g} s apart (median); {_EXPECTED}. Are they of "
            "both legs? List those of the leg with the device only.",
            path=file,
            channel=HEEL_STRIKES,
        )
    if recording.attrs["joint"] != "knee":
        return
    pct = _largest_flexion_pct(recording)
    if pct is not None and _STANCE_PCT[0] < pct < _STANCE_PCT[1]:
        raise DataError(
            f"{file}: the knee flexes most at {pct:.0f} % of the cycles that begin with its heel "
            "strikes; in walking it does at about 72 %. List the heel strikes of the leg with the "
            "device, or correct the angle's positive direction.",
            path=file,
            channel=HEEL_STRIKES,
        )


def _largest_flexion_pct(recording: xr.Dataset) -> float | None:
    """Return the median time of the largest flexion, % of the cycle; None without strides."""
    time, angle = recording["time"].to_numpy(), recording["angle"].to_numpy()
    angle = np.nan_to_num(angle if recording.attrs["positive"] == "flexion" else -angle)
    strides = find_strides(find_heel_strikes(recording).time_s, np.empty((0, 2)))
    edges = np.searchsorted(time, strides.strike_s)
    shares = [
        np.argmax(angle[a:b]) / (b - a)
        for a, b, accepted in zip(edges[:-1], edges[1:], strides.accepted, strict=True)
        if accepted and b > a
    ]
    return 100.0 * float(np.median(shares)) if shares else None


def _is_stamped(study: Study) -> bool:
    """Return whether the times are data: stamps, or the clock of a file that knows it."""
    return "time" in study.spec.channels or study.spec.sample_rate_hz is None


def stride_warnings(strides: Sequence[StrideRecord]) -> list[str]:
    """Return a warning for each recording whose accepted strides are not those of walking."""
    accepted = (stride for stride in strides if not stride.code)
    lengths = by_key(((s.participant, s.recording), s.duration_s) for s in accepted)
    return [
        f"{person}, {file}: strides last {median:.3g} s (median); {_EXPECTED}. Is the unit of time "
        "right, and the rate of the recorder? K, B, J and their status hold only if it is."
        for (person, file), own in lengths.items()
        if not is_walking_stride(median := float(np.median(own)))
    ]


def check_onsets(
    study: Study, entry: RecordingSpec, pieces: Sequence[xr.Dataset], table: pd.DataFrame
) -> None:
    """Refuse a pulse table whose onsets fit the recording only at another rate."""
    perturbed = [p for p in pieces if p.attrs["condition"] == "perturbed"]
    if len(perturbed) != 1:
        return
    own_hz = rate_hz(perturbed[0]["time"].to_numpy())
    onset_s = table["onset_s"].to_numpy(dtype=float)
    stamped = _is_stamped(study)
    scale = scale_of_onsets(perturbed[0], onset_s, rate_hz=own_hz, stamped=stamped)
    if scale is None:
        _check_ends(study, entry, perturbed[0], onset_s)
        return
    likely = f"{own_hz * scale:.6g}"
    where = f" at {own_hz:.6g} Hz, but they do at {likely} Hz."
    todo = f"Correct sample_rate_hz; likely {likely}."
    if stamped:
        where = f", but they do at {scale:.4g} times these onsets."
        todo = "Correct the unit of time, or the table's onset_s."
    raise DataError(
        f"{entry.file}: no pulses begin at the onsets of {entry.perturbations}{where} {todo}",
        path=entry.file,
    )


def check_lengths(
    study: Study, entry: RecordingSpec, pieces: Sequence[xr.Dataset], table: pd.DataFrame
) -> None:
    """Refuse a rate of the study at which pulses do not last as long as their table says."""
    if _is_stamped(study):
        return
    for piece in pieces:
        if piece.attrs["condition"] != "perturbed":
            continue
        numbers = table[["onset_s", "duration_s"]].to_numpy(dtype=float)
        first_s, last_s = piece["time"].to_numpy()[[0, -1]]
        own = numbers[(numbers[:, 0] >= first_s) & (numbers[:, 0] <= last_s)]
        likely = rate_of_lengths(piece, own[:, 0], own[:, 1])
        if likely is None:
            continue
        raise DataError(
            f"{entry.file}: its pulses last {likely.ratio:.2g} times as long as "
            f"{entry.perturbations} says (duration_s, median of {likely.n_pulses}) at "
            f"sample_rate_hz = {study.spec.sample_rate_hz:g}, and as long at {likely.rate_hz:g} "
            "Hz. Is that the rate? Correct sample_rate_hz; if it is right, correct duration_s.",
            path=entry.file,
        )


def _check_ends(
    study: Study, entry: RecordingSpec, recording: xr.Dataset, onset_s: np.ndarray
) -> None:
    """Refuse many onsets beyond the end of a recording whose rate only the study states."""
    own_hz, end_s = study.spec.sample_rate_hz or 1.0, float(recording["time"][-1])
    beyond = onset_s > end_s
    if _is_stamped(study) or beyond.sum() <= _MOST_BEYOND * beyond.size:
        return
    most_hz = own_hz * end_s / onset_s.max()
    likely = max((hz for hz in USUAL_HZ if hz <= most_hz), default=most_hz)
    raise DataError(
        f"{entry.file}: {beyond.sum()} of {beyond.size} onsets of {entry.perturbations} are "
        f"beyond its end, {end_s:.6g} s at sample_rate_hz = {own_hz:g}. At {likely:g} Hz or less "
        "all are within it: correct the rate, or remove these lines if it is right.",
        path=entry.file,
    )
