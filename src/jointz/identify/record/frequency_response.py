"""Frequency response of a joint, and K, B, J, from one time series."""

import numpy as np

from jointz.identify.record.frequency_response_second_order import estimate_second_order
from jointz.identify.record.frequency_response_spectra import impedance_spectra
from jointz.identify.record.joint_record import JointRequest
from jointz.identify.record.response_columns import response_curve
from jointz.results.series.frequency_response_fit import FrequencyResponseFit


def fit_frequency_response(request: JointRequest) -> FrequencyResponseFit:
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
    spectra = impedance_spectra(request)
    joint = estimate_second_order(request, spectra, model="frf")
    band = spectra.band
    frequency_hz = spectra.spectra.frequency_hz[band]
    s = 2j * np.pi * frequency_hz
    has_instrument = request.input == "torque" and "command" in request.record.channels
    return FrequencyResponseFit(
        **joint.result_fields(
            curve="Welch, Hann segments overlapping by half",
            instrument="command" if has_instrument else "none",
        ),
        vaf_pct=joint.fit.vaf_pct,
        response=response_curve(
            frequency_hz,
            spectra.impedance[band],
            relative_sd=spectra.relative_sd[band],
            coherence=spectra.coherence[band],
            n_averages=spectra.spectra.n_averages,
            ci_level=request.ci_level,
            fitted=joint.fit.values @ np.stack([np.ones_like(s), s, s**2]),
        ),
        resolution_hz=spectra.spectra.resolution_hz,
        n_averages=spectra.spectra.n_averages,
    )
