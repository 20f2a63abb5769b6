"""Loads on a bench from whole trials, the recommended method where a trial is one case."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jointz.core.codes import LISTED, Exclusion, Failure
from jointz.core.errors import EstimationError
from jointz.core.events import PulseRecord
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
from jointz.identify.regression.cell_regressions import DISSERTATION
from jointz.identify.regression.failed_cells import failed_cell
from jointz.results.bench.bench_fits import FullRecordFit
from jointz.results.estimates import CellEstimate

#: Below this VAF the load is not one linear load: a joint moves by itself, or the unperturbed
#: motion has a torque of its own.
_LEAST_VAF_PCT = 95.0


class FullRecordEstimator(CellEstimator):
    """Estimates every case of a bench from its whole trials.

    Recordings whose pulses belong to several cases or groups are estimated from the responses to
    their pulses, by the method ``dissertation``.
    """

    def __init__(
        self, participant: str, sources: Sequence[Source], settings: ParticipantSettings
    ) -> None:
        super().__init__(participant, DISSERTATION, sources, settings)

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
        others, records = super().run(by_pulse)
        coded |= {id(c): r for c, r in zip(by_pulse, records, strict=True)}
        return (*cells, *others), [coded[id(c)] for c in candidates]

    def _case(
        self, label: str, candidates: Sequence[Candidate]
    ) -> tuple[CellEstimate, dict[int, PulseRecord]]:
        """Return a case and its pulses with their codes."""
        codes = {i: self._trial_code(i, candidates) for i in {c.source for c in candidates}}
        records = {
            id(c): replace(c.record, code=self._code(c, codes[c.source])) for c in candidates
        }
        fit = self._fit(sorted(index for index, code in codes.items() if not code))
        n_used = sum(not r.code for r in records.values())
        n_excluded = len(records) - n_used
        if isinstance(fit, Failure):
            cell = failed_cell(
                fit,
                self._settings,
                participant=self._participant,
                timing_point=label,
                counts=(n_used, n_excluded),
                method=FULL_RECORD,
                baseline="none",
            )
            return cell, records
        cell = CellEstimate(
            participant=self._participant,
            timing_point=label,
            onset_gait_pct=None,
            parameters=tuple(fit.parameter(name) for name in PARAMETERS),
            vaf_pct=fit.vaf_pct,
            n_used=n_used,
            n_excluded=n_excluded,
            method=FULL_RECORD,
            baseline="none",
            condition_number=fit.condition_number,
            nuisance=tuple(p for p in fit.parameters if p.name not in PARAMETERS),
        )
        return cell, records

    def _fit(self, used: Sequence[int]) -> FullRecordFit | Failure:
        """Fit the trials that can be used as a whole."""
        if not used:
            return Failure.ALL_PULSES_EXCLUDED
        known = pooled_calibration([self._sources[i].input.calibration for i in used])
        try:
            fit = fit_full_record(
                [self._trial(index) for index in used],
                intrinsic=_intrinsic(known),
                torque_gain_sd=relative_sd(known.torque_gain),
                angle_gain_sd=relative_sd(known.angle_gain),
                lag_s=_lag(known),
            )
        except EstimationError as exc:
            return Failure(exc.code)
        misfit = fit.vaf_pct < _LEAST_VAF_PCT and not fit.settings["within_noise"]
        return Failure.NOT_ONE_LOAD if misfit else fit

    def _trial_code(self, index: int, candidates: Sequence[Candidate]) -> str:
        """Return the code of a trial that cannot be used as a whole, "" where it can."""
        recording = self._sources[index].input.recording
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

    def _code(self, candidate: Candidate, trial_code: str) -> str:
        """Return a pulse's code: that of its trial, whatever its own window would say.

        A pulse that begins outside of the samples is no part of the trial.
        """
        if candidate.record.code in LISTED:
            return candidate.record.code
        onset_s = np.array([candidate.record.onset_s])
        outside = is_outside(onset_s, self._sources[candidate.source])[0]
        return Exclusion.EDGE_OF_RECORD.value if outside else trial_code


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
