"""The certificate of a study, participant by participant."""

import math
from collections.abc import Mapping, Sequence
from zlib import crc32

import numpy as np

from jointz.core.events import row_label
from jointz.identify.appraisal.certificate import virtual_estimates
from jointz.identify.appraisal.certificate_draws import Injection
from jointz.identify.recommended.walking_estimator import METHOD as RECOMMENDED
from jointz.identify.recommended.walking_evidence import Evidence
from jointz.results.certificate_result import Certificate, VirtualEstimate, expected_errors

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
        method=RECOMMENDED,
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
