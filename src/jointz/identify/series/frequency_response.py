"""One time series of any joint to its frequency response."""

from collections.abc import Mapping
from typing import get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from scipy.stats import t as student_t

from jointz.core import provenance
from jointz.identify.series.frequency_response_second_order import estimate_second_order
from jointz.identify.series.frequency_response_spectra import (
    Input,
    JointSpectra,
    TorqueSide,
    joint_spectra,
    prepare_record,
)
from jointz.identify.series.joint_record import check_choice, gather_record
from jointz.results.series.frequency_response_curve import ResponseCurve
from jointz.results.series.frequency_response_fit import FrequencyResponseFit

_WHERE = "identify_frequency_response"
#: Where nothing is coherent the band is cut off here, so that files hold no infinities.
_WIDEST_BAND = 1e3


def identify_frequency_response(  # noqa: PLR0913 - the fixed public signature of identify
    recording: xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame | None = None,
    *,
    angle: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    command: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    input: Input = "torque",
    torque_acts_on: TorqueSide = "joint",
    cutoff_hz: float | None = None,
    ci_level: float = 0.95,
) -> FrequencyResponseFit:
    """Estimate the impedance of a joint over frequency, and K, B, J.

    The curve is Welch's with 16 Hann segments, half overlapping, of 4 s at most: a
    resonance narrower than ``resolution_hz`` reads too flat. K, B, J are not read
    off the curve: they are fitted to the spectra of the whole record, which have
    no such bias (:func:`jointz.kernels.series.spectra_second_order.fit_second_order`),
    weighted by the error. White noise of the input is taken off where the top
    of its spectrum shows it.

    It misleads when input names the wrong signal (torque inside the joint is
    then taken for its response; a warning tells where the record shows it),
    with reflexes, and with a lag between the sensors: a lag T reads as B + K T
    and J + B T.
    """
    check_choice("input", input, get_args(Input))
    check_choice("torque_acts_on", torque_acts_on, get_args(TorqueSide))
    if not 0.0 < ci_level < 1.0:
        raise ValueError(f"ci_level: expected 0 < ci_level < 1, got {ci_level}")
    given = {"angle": angle, "torque": torque, "command": command, "time": time}
    raw = gather_record(recording, given, rate_hz=rate_hz, where=_WHERE)
    record = prepare_record(raw, torque_acts_on)
    found = joint_spectra(record, perturbed=input, cutoff_hz=cutoff_hz, where=_WHERE)
    joint, _ = estimate_second_order(record, found, ci_level=ci_level, model="frf", where=_WHERE)
    return FrequencyResponseFit(
        model="frf",
        estimator=joint.estimator,
        input=input,
        parameters=joint.parameters,
        vaf_pct=joint.fit.vaf_pct,
        vaf_of="angle" if input == "torque" else "torque",
        status=joint.status,
        response=_curve(found, joint.fit.values, ci_level),
        resolution_hz=found.spectra.resolution_hz,
        n_averages=found.spectra.n_averages,
        n_samples=record.time.size,
        rate_hz=record.rate_hz,
        cutoff_hz=found.highest_hz,
        condition_number=joint.fit.condition_number,
        covariance=joint.covariance,
        ci_method=joint.ci_method,
        settings={
            "curve": "Welch, Hann segments overlapping by half",
            "instrument": "command" if input == "torque" and "command" in raw.channels else "none",
            "input_noise_sd": joint.input_noise_sd,
            "torque_acts_on": torque_acts_on,
            "ci_level": ci_level,
            "sha256": record.sha256,
            "jointz": provenance.software()["jointz"],
        },
        warnings=joint.warnings,
        check=joint.check,
    )


def _curve(found: JointSpectra, values: np.ndarray, ci_level: float) -> ResponseCurve:
    band = found.band
    frequency, impedance = found.spectra.frequency_hz[band], found.impedance[band]
    gain, sd = np.abs(impedance), found.relative_sd[band]
    freedom = max(2.0 * found.spectra.n_averages - 2.0, 1.0)
    wide = float(student_t.ppf((1.0 + ci_level) / 2.0, freedom))
    reach = np.minimum(np.exp(np.minimum(wide * sd, np.log(_WIDEST_BAND))), _WIDEST_BAND)
    s = 2j * np.pi * frequency
    model = values @ np.stack([np.ones_like(s), s, s**2])
    columns = {
        "frequency_hz": frequency,
        "gain": gain,
        "phase_rad": np.unwrap(np.angle(impedance)),
        "gain_low": gain / reach,
        "gain_high": gain * reach,
        "phase_sd_rad": np.minimum(sd, np.pi),
        "coherence": found.coherence[band],
        "fitted_gain": np.abs(model),
        "fitted_phase_rad": np.unwrap(np.angle(model)),
    }
    return ResponseCurve(**{name: tuple(v.tolist()) for name, v in columns.items()})
