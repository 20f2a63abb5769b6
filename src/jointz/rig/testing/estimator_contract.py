"""Contract test of an estimator: what ``jointz analyze`` expects of a method.

Subclass the contract in a test module and say how the estimator is made::

    from jointz.rig.testing.estimator_contract import EstimatorContract

    class TestMyMethod(EstimatorContract):
        def make(self):
            return MyMethod()

pytest does the rest, on simulated recordings of a joint of known impedance.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from functools import cache
from typing import ClassVar

import numpy as np
import pandas as pd
from scipy.signal import lfilter, lsim

from jointz.core.recording import build_recording
from jointz.core.study import Calibrated, CalibrationSpec, PerturbationsSpec
from jointz.identify.estimators import Estimates, Estimator, ParticipantData
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput, prepare_sources
from jointz.identify.study_kinds import KINDS, StudyKind
from jointz.results.estimates import ParameterEstimate
from jointz.rig.testing.contract_tests import _expect

#: K (N*m/rad), B (N*m*s/rad) and J (kg*m^2) of the joint.
JOINT = (60.0, 2.5, 0.08)
_RATE_HZ, _STRIDE_S, _N_PULSES, _PULSE_S, _PULSE_NM = 500.0, 1.1, 16, 0.25, 15.0
_STATUSES = ("ok", "at_bound", "undecided")


class EstimatorContract(ABC):
    """What holds for every estimator."""

    #: Relative error of K that is accepted outside its interval; None for a method whose
    #: assumptions these recordings do not meet.
    tolerance: ClassVar[float | None] = 0.25

    @abstractmethod
    def make(self) -> Estimator:
        """Return the estimator."""

    def test_it_has_a_name_and_serves_a_kind_of_study(self) -> None:
        """``--method`` takes the name; every kind has a baseline."""
        estimator = self.make()
        _expect(estimator.name.isidentifier(), f"name: expected a word, got {estimator.name!r}.")
        _expect(
            bool(estimator.kinds) and set(estimator.kinds) <= set(KINDS),
            f"kinds: expected some of {', '.join(KINDS)}, got {estimator.kinds}.",
        )
        for name in estimator.kinds:
            baseline = estimator.baseline_for(KINDS[name])
            _expect(bool(baseline), f"baseline_for({name}): expected a name, got {baseline!r}.")

    def test_every_pulse_and_parameter_is_accounted_for(self) -> None:
        """Pulses come back once; a cell counts all of its pulses; K agrees with the joint."""
        estimator = self.make()
        for name in estimator.kinds:
            data, estimates = self._estimates(estimator, KINDS[name])
            onsets = [p.onset_s for s in data.sources for p in s.pulses]
            reported = [p.onset_s for p in estimates.pulses]
            _expect(
                reported == onsets,
                f"pulses: expected all {len(onsets)} once and in order, got {len(reported)}.",
            )
            counts = Counter(p.timing_point for p in estimates.pulses)
            used = Counter(p.timing_point for p in estimates.pulses if not p.code)
            _expect(bool(estimates.cells), f"cells: expected one or more in {name}, got none.")
            for cell in estimates.cells:
                label = cell.timing_point
                _expect(
                    (cell.n_used, cell.n_excluded) == (used[label], counts[label] - used[label]),
                    f"{label}: expected n_used + n_excluded to count its pulses by their codes.",
                )
                _expect(
                    cell.method == estimator.name,
                    f"{label}: expected method {estimator.name}, got {cell.method}.",
                )
                _expect_parameters(cell.parameters[:3], label)
                self._expect_stiffness(cell.parameters[0], label)

    def test_the_same_data_give_the_same_estimates(self) -> None:
        """Random numbers come from the seed of the settings only, and data are not changed."""
        estimator = self.make()
        for name in estimator.kinds:
            _, first = self._estimates(estimator, KINDS[name])
            _, second = self._estimates(estimator, KINDS[name])
            _expect(
                [c.parameters for c in first.cells] == [c.parameters for c in second.cells],
                f"{name}: expected the same estimates from the same data and seed.",
            )

    def test_recordings_without_pulses_give_no_cell(self) -> None:
        """Nothing is raised, and nothing is estimated."""
        estimator = self.make()
        for name in estimator.kinds:
            settings = _settings(KINDS[name])
            unperturbed = [r for r in _recordings(KINDS[name]) if r.condition == "unperturbed"]
            data = ParticipantData("S01", prepare_sources(unperturbed, settings))
            estimates = estimator.estimate(data, settings)
            _expect(not estimates.cells, f"{name}: expected no cells without pulses.")

    def _estimates(
        self, estimator: Estimator, kind: StudyKind
    ) -> tuple[ParticipantData, Estimates]:
        settings = _settings(kind)
        data = ParticipantData("S01", prepare_sources(_recordings(kind), settings))
        return data, estimator.estimate(data, settings)

    def _expect_stiffness(self, stiffness: ParameterEstimate, label: str) -> None:
        value, low, high = stiffness.value, stiffness.ci_low, stiffness.ci_high
        if self.tolerance is None or value is None or low is None or high is None:
            return
        close = abs(value / JOINT[0] - 1.0) < self.tolerance or low <= JOINT[0] <= high
        _expect(
            close,
            f"{label}: expected a stiffness near {JOINT[0]:g} N*m/rad, got {value:.4g} "
            f"[{low:.4g}, {high:.4g}].",
        )


def _expect_parameters(parameters: Sequence[ParameterEstimate], label: str) -> None:
    names = [p.name for p in parameters]
    _expect(names == list(PARAMETERS), f"{label}: expected {PARAMETERS} first, got {names}.")
    for p in parameters:
        known = p.status in _STATUSES or p.status.startswith("failed:")
        _expect(known, f"{label}, {p.name}: expected a status of jointz, got {p.status!r}.")
        _expect(
            p.available == (p.value is not None),
            f"{label}, {p.name}: expected a value with status ok or at_bound only.",
        )


def _settings(kind: StudyKind) -> ParticipantSettings:
    return ParticipantSettings(
        kind=kind,
        perturbations=PerturbationsSpec(timing_points={"MST": 30.0}, source="table"),
        group_edges=(),
        torque_model=None,
        methods=(),
        n_resamples=50,
        seed=1,
        mass_kg=70.0,
    )


@cache
def _recordings(kind: StudyKind) -> tuple[RecordingInput, ...]:
    """Return an unperturbed and a perturbed recording."""
    rng = np.random.default_rng(5)
    return tuple(_recording(kind, c, rng) for c in ("unperturbed", "perturbed"))


def _recording(kind: StudyKind, condition: str, rng: np.random.Generator) -> RecordingInput:
    n_strides = 10 + 3 * _N_PULSES
    strikes = np.cumsum(_STRIDE_S * (1.0 + 0.02 * rng.standard_normal(n_strides)))
    time = np.arange(0.0, strikes[-1], 1.0 / _RATE_HZ)
    angle = 5e-4 * rng.standard_normal(time.size)
    torque = 0.02 * rng.standard_normal(time.size)
    channels = {}
    if kind.by_gait:
        phase = np.interp(time, strikes, np.arange(n_strides))
        size = np.interp(phase, np.arange(n_strides), 0.4 + 0.01 * rng.standard_normal(n_strides))
        angle += size * np.sin(2.0 * np.pi * phase) + 0.15 * np.sin(4.0 * np.pi * phase)
        channels["contact"] = (phase % 1.0 < 0.6).astype(float)
    onsets = strikes[8 + 3 * np.arange(_N_PULSES)] + 0.3 * _STRIDE_S
    perturbed = condition == "perturbed"
    pressed = (time[:, None] >= onsets) & (time[:, None] < onsets + _PULSE_S)
    command = np.where(pressed.any(axis=1), _PULSE_NM * perturbed, 0.0)
    pulses = lfilter([0.1], [1.0, -0.9], command)
    stiffness, damping, inertia = JOINT
    channels |= {
        "angle": angle + lsim(([1.0], [inertia, damping, stiffness]), pulses, time)[1],
        "torque": torque + pulses,
        "command": command,
    }
    recording = build_recording(
        time, channels, condition=condition, file=f"{condition}.csv", contact_kind="contact"
    )
    known = CalibrationSpec(angle_lag_s=Calibrated(value=0.0, sd=5e-4))
    if not perturbed:
        return RecordingInput(recording, known)
    table = {"onset_s": onsets, "duration_s": _PULSE_S, "amplitude_nm": _PULSE_NM}
    return RecordingInput(recording, known, pd.DataFrame(table | {"timing_point": "MST"}))
