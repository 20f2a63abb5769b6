"""Cells without an estimate, and the failure that follows from the codes of their pulses."""

from collections.abc import Collection

from jointz.core.codes import Exclusion, Failure
from jointz.identify.preparation.sources import ParticipantSettings
from jointz.identify.regression.cell_parameters import failed_parameters
from jointz.results.estimates import CellEstimate

#: The first code that any pulse of a timing point has decides on the failure.
_FAILURES = {
    Exclusion.NO_BASELINE: Failure.NO_UNPERTURBED_STRIDES,
    Exclusion.LONE_PULSE: Failure.TOO_FEW_PULSES,
    Exclusion.CONSTANT_ANGLE: Failure.CONSTANT_ANGLE,
    Exclusion.CONSTANT_TORQUE: Failure.CONSTANT_TORQUE,
    Exclusion.NO_TORQUE: Failure.CONSTANT_TORQUE,
    Exclusion.NO_RESPONSE: Failure.CONSTANT_ANGLE,
}


def failure_of_codes(codes: Collection[str]) -> Failure:
    """Return why a timing point has no estimate, from the codes of its excluded pulses."""
    if set(codes) == {Exclusion.NO_HEEL_STRIKES.value}:
        return Failure.NO_HEEL_STRIKES
    failures = (failure for code, failure in _FAILURES.items() if code.value in codes)
    return next(failures, Failure.ALL_PULSES_EXCLUDED)


def failed_cell(
    failure: Failure,
    settings: ParticipantSettings,
    *,
    participant: str,
    timing_point: str,
    counts: tuple[int, int],
    method: str,
    baseline: str,
    onset_gait_pct: float | None = None,
) -> CellEstimate:
    """Return a cell without values; ``counts`` are of the pulses used and excluded."""
    return CellEstimate(
        participant=participant,
        timing_point=timing_point,
        onset_gait_pct=onset_gait_pct,
        parameters=failed_parameters(
            failure, mass_kg=settings.mass_kg, wants_per_mass=settings.kind.per_mass
        ),
        vaf_pct=None,
        n_used=counts[0],
        n_excluded=counts[1],
        method=method,
        baseline=baseline,
    )
