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
_NOTHING = "no pulse that could be predicted"


def certify_participant(
    evidence: Sequence[Evidence], injection: Injection, *, replicates: int, seed: int
) -> list[VirtualEstimate]:
    """Inject into the strides of one participant; nothing where nothing could be explained."""
    estimates: list[VirtualEstimate] = []
    for own in evidence:
        # By name: a participant more or less changes nobody else's draws.
        name = row_label(own.participant, own.session, own.side)
        rng = np.random.default_rng([seed, crc32(name.encode())])
        for found in virtual_estimates(own, injection, replicates=replicates, rng=rng):
            estimates += found
    return estimates


def assembled(
    found: Mapping[str, Sequence[VirtualEstimate]],
    injection: Injection,
    *,
    replicates: int,
    seed: int,
    window_s: float,
) -> Certificate:
    """Put the participants' injections together."""
    estimates = tuple(e for mine in found.values() for e in mine)
    return Certificate(
        method=RECOMMENDED,
        errors=expected_errors(estimates),
        estimates=estimates,
        n_participants=sum(bool(mine) for mine in found.values()),
        replicates=replicates,
        injected=injection.described(),
        left_out={person_id: _NOTHING for person_id, mine in found.items() if not mine},
        settings={"seed": seed, "window_s": window_s},
    )


def replicates_for(participants: int, *, virtual: int = VIRTUAL_PARTICIPANTS) -> int:
    """Return how many injections a participant tell the RMSE of a study to 10 %."""
    return math.ceil(virtual / max(participants, 1))
