"""The certificate of a study, participant by participant."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from zlib import crc32

import numpy as np

from jointz.core.events import row_label
from jointz.core.method_names import RIGID
from jointz.identify.appraisal.certificate_draws import Injection, Truth, drawn_truth
from jointz.identify.appraisal.certificate_joint import InjectedResponse, injected_response
from jointz.identify.prediction.predicted_cells import PredictedCell, unlike_from
from jointz.identify.prediction.unperturbed_prediction import LEAD_SAMPLES, Predicted
from jointz.identify.rigid.response_decision import Decision, NaturalSize, decided_parameters
from jointz.identify.rigid.response_model import CellResponse
from jointz.identify.rigid.response_posterior import JointPosterior
from jointz.identify.rigid.walking_evidence import Evidence
from jointz.identify.rigid.walking_responses import explain_responses, priors_of
from jointz.kernels.robust_spread import robust_moments
from jointz.results.certificate_result import (
    PARAMETERS,
    Certificate,
    VirtualEstimate,
    expected_errors,
)
from jointz.results.estimates import ParameterEstimate

#: So many virtual participants in all tell a RMSE to 10 %: the sd of a root mean square of n
#: errors is 1 / sqrt(2 n) of it.
VIRTUAL_PARTICIPANTS = 50
_NO_PULSES = "no pulse that could be predicted"


def certify_participant(
    evidence: Sequence[Evidence], injection: Injection, *, replicates: int, seed: int
) -> list[VirtualEstimate]:
    """Inject into the strides of one participant; empty without evidence."""
    estimates: list[VirtualEstimate] = []
    for unit in evidence:
        # By name: a participant more or less changes nobody else's draws.
        name = row_label(unit.participant, unit.session, unit.side)
        rng = np.random.default_rng([seed, crc32(name.encode())])
        for replicate in virtual_estimates(unit, injection, replicates=replicates, rng=rng):
            estimates += replicate
    return estimates


def assembled(
    by_participant: Mapping[str, Sequence[VirtualEstimate]],
    injection: Injection,
    *,
    replicates: int,
    seed: int,
    window_s: float,
) -> Certificate:
    """Put the participants' injections together."""
    estimates = tuple(e for rows in by_participant.values() for e in rows)
    return Certificate(
        method=RIGID,
        errors=expected_errors(estimates),
        estimates=estimates,
        n_participants=sum(bool(rows) for rows in by_participant.values()),
        replicates=replicates,
        injected=injection.described(),
        left_out={person_id: _NO_PULSES for person_id, rows in by_participant.items() if not rows},
        settings={"seed": seed, "window_s": window_s},
    )


def replicates_for(participants: int, *, virtual: int = VIRTUAL_PARTICIPANTS) -> int:
    """Return the injections a participant that estimate the RMSE of a study to 10 %."""
    return math.ceil(virtual / max(participants, 1))


def virtual_estimates(
    evidence: Evidence, injection: Injection, *, replicates: int, rng: np.random.Generator
) -> Iterator[list[VirtualEstimate]]:
    """Inject and estimate, one replicate at a time.

    The participant's own torque drives the injected joint, and misses at virtual onsets bring
    the noise of angle and torque with all its correlations. Misleads where the study is
    outside the estimator's models - a reflex, a second tissue: what no hypothesis holds cannot
    be drawn from them. What a pulse changes in the strides after it is not in it either.
    """
    for replicate in range(replicates):
        truth = drawn_truth(evidence, injection, rng)
        yield _estimated(evidence, truth, replicate, rng)


def _estimated(
    evidence: Evidence, truth: Truth, replicate: int, rng: np.random.Generator
) -> list[VirtualEstimate]:
    injected = [_injected(evidence, truth, i) for i in range(len(evidence.cells))]
    cells = [
        virtual_cell(cell, response.shown, rng)
        for cell, response in zip(evidence.cells, injected, strict=True)
    ]
    posterior, responses = explain_responses(
        cells, priors_of(evidence.known), window_s=evidence.window_s
    )
    estimates = _rows(evidence, posterior, responses)
    return [
        VirtualEstimate(
            participant=evidence.participant,
            replicate=replicate,
            timing_point=label,
            parameter=row.name,
            truth=_true_value(row.name, truth, injected[i], i),
            value=row.value,
            ci_low=row.ci_low,
            ci_high=row.ci_high,
            status=row.status,
            session=evidence.session,
            side=evidence.side,
        )
        for i, (label, rows) in enumerate(estimates.items())
        for row in rows
    ]


def own_estimates(evidence: Evidence) -> dict[str, tuple[ParameterEstimate, ...]]:
    """Return K, B and J of every timing point, estimated from the study's own pulses."""
    return _rows(evidence, evidence.posterior, evidence.responses)


def _rows(
    evidence: Evidence, posterior: JointPosterior, responses: Sequence[CellResponse]
) -> dict[str, tuple[ParameterEstimate, ...]]:
    estimates = {}
    for i, response in enumerate(responses):
        decision = Decision(
            known=evidence.known,
            subtract_intrinsic=evidence.subtract_intrinsic[i],
            mass_kg=None,
            natural=NaturalSize.of(response),
        )
        rows = {row.name: row for row in decided_parameters(i, posterior, decision)}
        estimates[response.label] = tuple(rows[name] for name in PARAMETERS)
    return estimates


def _injected(evidence: Evidence, truth: Truth, i: int) -> InjectedResponse:
    """Let the injected joint answer the torque that was measured at its timing point."""
    cell = evidence.cells[i]
    average = cell.predicted.responses[cell.kept].mean(axis=0)
    torque = truth.torque_gain * (average[1] + truth.friction_gain * average[2])
    return injected_response(
        torque,
        truth.joints[i],
        period_s=cell.period_s,
        window_s=evidence.window_s + LEAD_SAMPLES * cell.period_s,
    )


def _true_value(name: str, truth: Truth, response: InjectedResponse, i: int) -> float:
    value = truth.joints[i].inertia if name == "inertia" else getattr(response, name)
    return float(value) - truth.intrinsic[name][i]


def virtual_cell(cell: PredictedCell, angle: np.ndarray, rng: np.random.Generator) -> PredictedCell:
    """Return a timing point of virtual pulses: as many as there were, at unperturbed strides.

    No stride serves twice, unless there are fewer than two a pulse. The average of n strides
    drawn from N without replacement varies less than that of n pulses against a baseline
    learned from N: by 1/n - 1/N instead of 1/n + 1/N. Deviations are scaled by the root of
    the ratio.
    """
    used = cell.used
    misses, strides = _usual_misses(cell.predicted)
    places = _one_a_stride(strides, rng)
    n, available = len(used), places.size
    with_replacement = 2 * n > available
    chosen = rng.choice(places, size=n, replace=with_replacement)
    variance = 1.0 / n if with_replacement else 1.0 / n - 1.0 / available
    scale = np.sqrt((1.0 / n + 1.0 / available) / variance)
    responses = scale * (misses[chosen] - misses.mean(axis=0))
    average = cell.predicted.responses[cell.kept].mean(axis=0)
    responses[:, 0] += angle
    responses[:, 1:] += average[1:]
    return replace(
        cell,
        candidates=used,
        predicted=replace(cell.predicted, responses=responses, codes=("",) * n),
        kept=np.ones(n, dtype=bool),
    )


def _usual_misses(predicted: Predicted) -> tuple[np.ndarray, np.ndarray]:
    """Return misses within the limits of a used pulse, and their strides."""
    angles = predicted.misses[:, 0]
    middle, sd = robust_moments(angles)
    fine = (np.abs(angles - middle) <= unlike_from(sd)).all(axis=1)
    return predicted.misses[fine], predicted.strides[fine]


def _one_a_stride(strides: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the place of one virtual onset of each stride."""
    mixed = rng.permutation(strides.size)
    _, first = np.unique(strides[mixed], return_index=True)
    return np.asarray(mixed[first])
