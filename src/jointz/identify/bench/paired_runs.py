"""Perturbation stiffness from pairs of runs: perturbed less unperturbed (2.2.3, 3.2.3)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointz.core import provenance
from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.bench_estimates import NEGATIVE_STIFFNESS, bench_estimates
from jointz.identify.bench.paired_responses import PairResponses, check_same_rate, pair_responses
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.preparation.conditioning import ACCELERATION, ANGLE, TORQUE
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.record.block_regression import fitted_sandwich, t_factor
from jointz.identify.record.joint_record import Samples, check_level
from jointz.kernels.bounded_lsq import condition_numbers, least_squares, normal_equations
from jointz.results.bench.paired_runs_fit import MeanResponse, PairedPulse, PairedRunsFit
from jointz.results.estimates import FEWEST_PULSES

_WHERE = "identify_paired_runs"
_DUST_RAD = 1e-9
_DUST_NM = 1e-9
#: Share of noise in the acceleration above which a warning is given.
_TOLD_NOISE_SHARE = 0.002


@dataclass(frozen=True, slots=True)
class _Responses:
    """Responses of all pairs: pulses with the number of their pair, (p, 4, n) windows."""

    pulses: tuple[tuple[int, Pulse], ...]  # number of the pair, pulse
    windows: np.ndarray  # angle (rad), velocity (rad/s), acceleration (rad/s^2), torque (N*m)
    left_out: tuple[str, ...]  # excluded pulses with the reason, as text
    rate_hz: float


def identify_paired_runs(
    pairs: Sequence[tuple[Samples, Samples]],
    *,
    pulses: Sequence[Sequence[Pulse]] | None = None,
    align: str = "reference",
    window_s: float = 0.1,
    cutoff_hz: float = 20.0,
    ci_level: float = 0.95,
) -> PairedRunsFit:
    """Fit K, B and J to the differences of perturbed and unperturbed runs along one reference.

    Parameters
    ----------
    pairs : sequence of (unperturbed, perturbed)
        Each run an xarray.Dataset, mapping or pandas.DataFrame with ``time``, ``angle``,
        ``torque`` (on the load) and the channel that ``align`` names, in SI; the perturbed
        one also with ``command``, zero outside pulses, unless ``pulses`` are given.
    pulses : sequence of sequence of Pulse, optional
        The pulses of each perturbed run, on its clock.
    align : str
        The channel that both runs of a pair follow.
    window_s : float, s
        Length of the response from the onset.
    cutoff_hz : float, Hz
        Zero-phase low-pass of angle and torque, before anything is cut.
    ci_level : float
        Level of the intervals.

    Returns
    -------
    PairedRunsFit
        ``stiffness``, ``damping``, ``inertia`` over all pulses, every pulse by itself, the
        shifts found between the runs, what was left out.

    Raises
    ------
    DataError
        When there is no pair, samples cannot be trusted (missing channel, NaN, gap), the two
        runs of a pair have other rates or references, or a setting is out of range.
    EstimationError
        ``no_pulses``, ``too_few_pulses`` (below two that can be used),
        ``constant_angle``, ``constant_torque``, ``ill_conditioned``.

    Notes
    -----
    torque = K*angle + B*velocity + J*acceleration (2.1), by least squares without bounds, on
    the differences. The unperturbed run is shifted to where its reference passes as the
    perturbed run's does (:func:`jointz.identify.bench.paired_responses.reference_shift`) and read
    between its samples. Interval: sandwich with the pulses as clusters, Student's t with as
    many degrees of freedom as there are pulses beyond three; it does not know the gain of a
    sensor. Whatever is late in the torque record, or follows the pulse only (friction that
    turns, a controller), is read as impedance. Noise of the angle lowers the inertia, and
    the stiffness with it, by several times its share of the acceleration: ``cutoff_hz`` keeps it
    small, a warning tells where it is not. Where the whole run is one linear load,
    :func:`jointz.identify.bench.full_record.fit_full_record` does without both runs and says more.
    """
    check_level(_WHERE, ci_level)
    _check_settings(pairs, pulses, window_s)
    tables = [None] * len(pairs) if pulses is None else list(pulses)
    pair_results = [
        pair_responses(
            pair,
            table,
            align=align,
            window_s=window_s,
            cutoff_hz=cutoff_hz,
            where=f"{_WHERE}: pair {number}",
        )
        for number, (pair, table) in enumerate(zip(pairs, tables, strict=True), start=1)
    ]
    responses = _joined(pair_results)
    gram, moment, power = normal_equations(responses.windows)
    pooled = least_squares(gram.sum(axis=0)[None], moment.sum(axis=0)[None])[0]
    if not np.isfinite(pooled).all():
        raise EstimationError(
            Failure.ILL_CONDITIONED,
            f"{_WHERE}: the responses cannot tell stiffness, damping and inertia apart. Make the "
            "window longer, or perturb faster.",
        )
    error = float(power.sum() - 2.0 * pooled @ moment.sum(axis=0))
    error += float(pooled @ gram.sum(axis=0) @ pooled)
    noise_share = _noise_share(pair_results, responses)
    half_width, ci_method = _half_widths(pooled, gram, moment, ci_level)
    return PairedRunsFit(
        parameters=bench_estimates(
            dict(zip(PARAMETERS, pooled.tolist(), strict=True)),
            half_width,
            ci_level=ci_level,
            ci_method=ci_method,
        ),
        pulses=_singles(responses, gram, moment, power),
        left_out=responses.left_out,
        shifts_s=tuple(pair.shift_s for pair in pair_results),
        vaf_pct=100.0 * (1.0 - error / float(power.sum())),
        rate_hz=responses.rate_hz,
        cutoff_hz=cutoff_hz,
        window_s=window_s,
        condition_number=float(condition_numbers(gram.sum(axis=0)[None])[0]),
        ci_method=ci_method,
        settings={
            "align": align,
            "acceleration_noise_share": noise_share,
            "ci_level": ci_level,
            "jointz": provenance.software()["jointz"],
        },
        warnings=_warnings(pooled, noise_share),
        response=_mean_response(responses, pooled),
    )


def _check_settings(
    pairs: Sequence[tuple[Samples, Samples]],
    pulses: Sequence[Sequence[Pulse]] | None,
    window_s: float,
) -> None:
    problems = []
    if not pairs:
        problems.append("pairs: expected at least one (unperturbed, perturbed), got none.")
    if any(not isinstance(pair, tuple | list) or len(pair) != 2 for pair in pairs):
        problems.append("pairs: expected (unperturbed, perturbed) each. A run has no partner.")
    if pulses is not None and len(pulses) != len(pairs):
        problems.append(
            f"pulses: expected one list a pair, {len(pairs)} in all, got {len(pulses)}."
        )
    if not 0.0 < window_s < np.inf:
        problems.append(f"window_s: expected > 0 s, got {window_s:g}.")
    if problems:
        raise DataError(f"{_WHERE}: " + " ".join(problems))


def _joined(pairs: Sequence[PairResponses]) -> _Responses:
    """Put the responses of all pairs together, if there are enough of them."""
    for number, pair in enumerate(pairs, start=1):
        check_same_rate(f"{_WHERE}: pair {number}", pairs[0].rate_hz, pair.rate_hz)
    numbered = list(enumerate(pairs, start=1))
    responses = _Responses(
        pulses=tuple((number, pulse) for number, pair in numbered for pulse in pair.pulses),
        windows=np.concatenate([pair.windows for pair in pairs]),
        left_out=tuple(
            f"pair {number}, pulse at {pulse.onset_s:.6g} s: {why}"
            for number, pair in numbered
            for pulse, why in pair.left_out
        ),
        rate_hz=pairs[0].rate_hz,
    )
    _check_responses(responses)
    return responses


def _check_responses(responses: _Responses) -> None:
    if not responses.pulses and not responses.left_out:
        raise EstimationError(
            Failure.NO_PULSES, f"{_WHERE}: no pulse. Give pulses, or look at the command."
        )
    if len(responses.pulses) < FEWEST_PULSES:
        raise EstimationError(
            Failure.TOO_FEW_PULSES,
            f"{_WHERE}: expected at least {FEWEST_PULSES} pulses that both runs hold, got "
            f"{len(responses.pulses)} ({'; '.join(responses.left_out)}). Record longer runs.",
        )
    for row, rounding, code in (
        (ANGLE, _DUST_RAD, Failure.CONSTANT_ANGLE),
        (TORQUE, _DUST_NM, Failure.CONSTANT_TORQUE),
    ):
        size = float(np.abs(responses.windows[:, row]).max())
        if size < rounding:
            raise EstimationError(
                code,
                f"{_WHERE}: {code.meaning}; {size:.3g} at most. Check that the second run of "
                "each pair is the perturbed one.",
            )


def _half_widths(
    pooled: np.ndarray, gram: np.ndarray, moment: np.ndarray, ci_level: float
) -> tuple[np.ndarray, str]:
    """Return half of the intervals, with the pulses as clusters, and how they were made."""
    n_pulses, freedom = len(gram), len(gram) - len(PARAMETERS)
    if freedom <= 0:
        return np.full(len(PARAMETERS), np.nan), "none: three pulses or fewer"
    size = np.sqrt(np.diagonal(gram.sum(axis=0)))
    scores, bread = moment - gram @ pooled, gram.sum(axis=0) / np.outer(size, size)
    scaled = fitted_sandwich(scores / size, bread, n_pulses)
    half_width = t_factor(ci_level, freedom) * np.sqrt(np.diag(scaled)) / size
    return half_width, f"sandwich over {n_pulses} pulses, Student's t"


def _singles(
    responses: _Responses, gram: np.ndarray, moment: np.ndarray, power: np.ndarray
) -> tuple[PairedPulse, ...]:
    """Fit every pulse by itself; a pulse without a finite fit is left out."""
    values = least_squares(gram, moment)
    explained = 2.0 * np.einsum("pk,pk->p", values, moment)
    explained -= np.einsum("pk,pkl,pl->p", values, gram, values)
    return tuple(
        PairedPulse(
            pair=pair,
            onset_s=pulse.onset_s,
            sign=int(pulse.sign),
            stiffness=row[0],
            damping=row[1],
            inertia=row[2],
            vaf_pct=float(vaf),
        )
        for (pair, pulse), row, vaf in zip(
            responses.pulses, values.tolist(), 100.0 * explained / power, strict=True
        )
        if np.isfinite(row).all()
    )


def _noise_share(pairs: Sequence[PairResponses], responses: _Responses) -> float:
    """Return the share of noise in the power of the responses' acceleration."""
    noise = sum(len(pair.pulses) * pair.acceleration_noise_sd**2 for pair in pairs)
    return float(noise / len(responses.pulses) / np.mean(responses.windows[:, ACCELERATION] ** 2))


def _warnings(pooled: np.ndarray, noise_share: float) -> tuple[str, ...]:
    warnings = []
    if pooled[0] < 0.0:
        warnings.append(NEGATIVE_STIFFNESS)
    if noise_share > _TOLD_NOISE_SHARE:
        warnings.append(
            f"about {100.0 * noise_share:.2g} % of the acceleration is noise of the angle: "
            "inertia and stiffness read low, the damping high. Lower cutoff_hz"
        )
    return tuple(warnings)


def _mean_response(responses: _Responses, pooled: np.ndarray) -> MeanResponse:
    signs = np.array([pulse.sign for _, pulse in responses.pulses])
    mean = np.mean(signs[:, None, None] * responses.windows, axis=0)
    columns = (np.arange(mean.shape[1]) / responses.rate_hz, mean[TORQUE], pooled @ mean[:TORQUE])
    return MeanResponse(*(tuple(column.tolist()) for column in columns))
