"""Loads on a bench from whole trials, the recommended method where a trial is one case."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jointz.core.codes import LISTED, Exclusion, Failure
from jointz.core.errors import EstimationError
from jointz.core.events import PulseEstimate, PulseRecord
from jointz.core.method_names import FULL_RECORD
from jointz.core.recording import damage_near, damage_of, deflection
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.gait.timestamps import find_gaps
from jointz.identify.bench.bench_records import FEWEST_SAMPLES, BenchTrial
from jointz.identify.bench.full_record import Impedance, fit_full_record
from jointz.identify.preparation.assignment import Candidate, is_outside
from jointz.identify.preparation.calibration import (
    joint_angle,
    pooled_calibration,
    relative_sd,
    twist_sd,
    value_of,
)
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.identify.regression.cell_estimator import CellEstimator
from jointz.identify.regression.cell_parameters import failed_parameters
from jointz.identify.regression.cell_regressions import DISSERTATION
from jointz.results.bench.bench_fits import FullRecordFit
from jointz.results.estimates import CellEstimate

#: Below this VAF the load is not one linear load: a joint moves by itself, or the unperturbed
#: motion has a torque of its own.
_LEAST_VAF_PCT = 95.0


class FullRecordEstimator:
    """Estimates every case of a bench from its whole trials.

    Recordings whose pulses belong to several cases or groups are estimated from the responses to
    their pulses, by the method ``dissertation``.
    """

    def __init__(
        self, participant: str, sources: Sequence[Source], settings: ParticipantSettings
    ) -> None:
        self._participant = participant
        self._sources = sources
        self._settings = settings
        self._by_pulse = CellEstimator(participant, DISSERTATION, sources, settings)

    @property
    def baseline(self) -> str:
        """Baseline of the method for mixed recordings, by which pulses are assigned."""
        return self._by_pulse.baseline

    @property
    def single(self) -> tuple[PulseEstimate, ...]:
        """Pulses of mixed recordings, each estimated by itself."""
        return self._by_pulse.single

    def run(
        self, candidates: Sequence[Candidate]
    ) -> tuple[tuple[CellEstimate, ...], list[PulseRecord]]:
        """Return the cells and the pulses with their final codes."""
        cases: dict[int, set[str]] = {}
        for candidate in candidates:
            cases.setdefault(candidate.source, set()).add(candidate.record.timing_point)
        mixed = {label for labels in cases.values() if len(labels) > 1 for label in labels}
        cells: list[CellEstimate] = []
        coded: dict[int, PulseRecord] = {}
        by_pulse = []
        for label in dict.fromkeys(c.record.timing_point for c in candidates):
            pulses = [c for c in candidates if c.record.timing_point == label]
            if label in mixed:
                by_pulse += pulses
                continue
            cell, records_of_case = self._case(label, pulses)
            cells.append(cell)
            coded |= records_of_case
        others, records = self._by_pulse.run(by_pulse)
        coded |= {id(c): r for c, r in zip(by_pulse, records, strict=True)}
        return (*cells, *others), [coded[id(c)] for c in candidates]

    def _case(
        self, label: str, candidates: Sequence[Candidate]
    ) -> tuple[CellEstimate, dict[int, PulseRecord]]:
        """Return a case and its pulses with their codes."""
        why = {index: self._why_not(index, candidates) for index in {c.source for c in candidates}}
        records = {id(c): replace(c.record, code=self._code(c, why[c.source])) for c in candidates}
        used = sorted(index for index, code in why.items() if not code)
        n_used = sum(not r.code for r in records.values())
        if not used:
            return self._cell(label, Failure.ALL_PULSES_EXCLUDED, records, n_used=0), records
        trials = [self._trial(index) for index in used]
        known = pooled_calibration([self._sources[i].input.calibration for i in used])
        try:
            fit = fit_full_record(
                trials,
                intrinsic=_intrinsic(known),
                torque_gain_sd=relative_sd(known.torque_gain),
                angle_gain_sd=relative_sd(known.angle_gain),
                lag_s=_lag(known),
            )
        except EstimationError as exc:
            return self._cell(label, Failure(exc.code), records, n_used=n_used), records
        if fit.vaf_pct < _LEAST_VAF_PCT and not fit.settings["within_noise"]:
            return self._cell(label, Failure.NOT_ONE_LOAD, records, n_used=n_used), records
        return self._cell(label, fit, records, n_used=n_used), records

    def _cell(
        self,
        label: str,
        outcome: FullRecordFit | Failure,
        records: dict[int, PulseRecord],
        *,
        n_used: int,
    ) -> CellEstimate:
        fit = outcome if isinstance(outcome, FullRecordFit) else None
        if isinstance(outcome, FullRecordFit):
            parameters = tuple(outcome.parameter(name) for name in PARAMETERS)
        else:
            settings = self._settings
            parameters = failed_parameters(
                outcome, mass_kg=settings.mass_kg, wants_per_mass=settings.kind.per_mass
            )
        return CellEstimate(
            participant=self._participant,
            timing_point=label,
            onset_gait_pct=None,
            parameters=parameters,
            vaf_pct=fit.vaf_pct if fit else None,
            n_used=n_used,
            n_excluded=len(records) - n_used,
            method=FULL_RECORD,
            baseline="none",
            condition_number=fit.condition_number if fit else None,
            nuisance=tuple(p for p in fit.parameters if p.name not in PARAMETERS) if fit else (),
        )

    def _why_not(self, index: int, candidates: Sequence[Candidate]) -> str:
        """Return why a trial cannot be used as a whole, "" where it can."""
        source = self._sources[index]
        recording = source.input.recording
        time = recording["time"].to_numpy()
        if any(c.source == index and c.record.code in LISTED for c in candidates):
            return Exclusion.USER.value
        if time.size < FEWEST_SAMPLES:
            return Exclusion.EDGE_OF_RECORD.value
        if damage_near(damage_of(recording), time[0], time[-1]):
            return Exclusion.DAMAGED_LOG.value
        if find_gaps(time).size:
            return Exclusion.GAP.value
        signals = [deflection(recording), recording["torque"].to_numpy()]
        if not all(np.isfinite(values).all() for values in signals):
            return Exclusion.NOT_FINITE.value
        codes = (Exclusion.CONSTANT_ANGLE.value, Exclusion.CONSTANT_TORQUE.value)
        constant = [code for values, code in zip(signals, codes, strict=True) if not np.ptp(values)]
        return constant[0] if constant else ""

    def _trial(self, index: int) -> BenchTrial:
        source = self._sources[index]
        recording, known = source.input.recording, source.input.calibration
        return BenchTrial(
            time_s=recording["time"].to_numpy(),
            angle=joint_angle(deflection(recording), recording["torque"].to_numpy(), known),
            torque=recording["torque"].to_numpy() / value_of(known.torque_gain, 1.0),
            angle_per_torque_sd=twist_sd(known),
        )

    def _code(self, candidate: Candidate, why: str) -> str:
        """Return a pulse's code: its trial's, or none, whatever its own window would say.

        One that begins outside of the samples is no part of the trial.
        """
        if candidate.record.code in LISTED:
            return candidate.record.code
        onset_s = np.array([candidate.record.onset_s])
        outside = is_outside(onset_s, self._sources[candidate.source])[0]
        return Exclusion.EDGE_OF_RECORD.value if outside else why


def _lag(known: CalibrationSpec) -> tuple[float, float] | None:
    """Return the known lag of the torque behind the angle, and its sd; either entry is enough."""
    torque, angle = known.torque_lag_s, known.angle_lag_s
    if torque is None and angle is None:
        return None
    zero = Calibrated(value=0.0, sd=0.0)
    torque, angle = torque or zero, angle or zero
    return torque.value - angle.value, float(np.hypot(torque.sd, angle.sd))


def _intrinsic(known: CalibrationSpec) -> Impedance:
    values: dict[str, float] = {}
    for name in PARAMETERS:
        if (entry := getattr(known, f"intrinsic_{name}")) is not None:
            values |= {name: entry.value, f"{name}_sd": entry.sd}
    return Impedance(**values)
