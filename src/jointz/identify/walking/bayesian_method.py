"""The method ``bayesian`` of ``jointz analyze``: a physical model of leg, device and sensors.

Strapped to the leg, the device moves against the bone on strap and tissue, and K softens with
displacement; coupled rigidly, it moves with the bone. In both, K and B drift over the pulse, a
reflex answers, and all timing points and shapes of pulse of a participant are explained together.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from jointz.core.codes import Doubt, Failure
from jointz.core.errors import DataError
from jointz.core.events import PulseRecord
from jointz.core.gait_phases import mean_phase
from jointz.core.method_names import BAYESIAN, PREDICTED
from jointz.core.study import CalibrationSpec
from jointz.identify.estimators import Estimates, ParticipantData
from jointz.identify.prediction.predicted_cells import CellPredictor, PredictedCell, PredictedShapes
from jointz.identify.prediction.pulse_checks import has_pulses_in_strides
from jointz.identify.prediction.signal_checks import common_failure
from jointz.identify.preparation.assignment import Candidate, assign_pulses
from jointz.identify.preparation.calibration import pooled_calibration
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.preparation.instrument_checks import angle_failure, torque_failure
from jointz.identify.preparation.raw_signals import intrinsic_left_in
from jointz.identify.preparation.sensor_agreement import SensorChoice, with_goniometer_gain
from jointz.identify.preparation.sources import ParticipantSettings
from jointz.identify.regression.failed_cells import failed_cell, failure_of_codes
from jointz.identify.study_kinds import StudyKind
from jointz.identify.walking.body import Body, body_of
from jointz.identify.walking.checks import differs_with_size, lag_failure, response_failure
from jointz.identify.walking.coupling import COUPLINGS, Coupling
from jointz.identify.walking.decisions import (
    Decision,
    decided_rows,
    doubts_of,
    only_limits,
    rejects_value,
    unlikely_inertias,
    unlikely_instruments,
    unlikely_lag,
)
from jointz.identify.walking.estimands import ESTIMANDS, LogMoments, log_moments
from jointz.identify.walking.gravity import participant_stiffness_without_gravity
from jointz.identify.walking.information import remaining_sds
from jointz.identify.walking.instruments import (
    calibrated_lag,
    friction_of_model,
    instrument_priors,
    lags_of_instruments,
)
from jointz.identify.walking.leg_model import LegModel
from jointz.identify.walking.posterior import LegPosterior, explain
from jointz.identify.walking.prior import LegPriors
from jointz.identify.walking.responses import PointResponse, ShapeAverage, corrected, point_response
from jointz.results.estimates import CellEstimate, ParameterEstimate, PulseExample, Response
from jointz.results.impedance_limits import LARGEST_IMPEDANCE
from jointz.results.log_posterior import LogPosterior
from jointz.results.unlikely_parameter import UnlikelyParameter

LONGEST_WINDOW_S = 0.25
#: Beyond the data that are used, for sensors that lag.
_MARGIN_S = 0.03
#: A fit that explains less of the responses explains nothing.
_LEAST_VAF_PCT = 50.0
#: Doubts that speak neither against sensors nor device.
_HARMLESS = frozenset({Doubt.HELD_TORQUE, Doubt.SENSORS_CONTRADICT})
#: Doubts that one sensor of several may cause.
_OF_SENSOR_MODEL = frozenset({Doubt.INSTRUMENTS_UNLIKELY, Doubt.RESPONSES_MISFIT})
#: Parameters that compare a sensor with the others.
_OF_SENSORS = frozenset(
    {
        *("sensor_delay_s", "sensor_lag_s", "goniometer_gain", "encoder_delay_s", "encoder_gain"),
        *("gyroscope_delay_s", "gyroscope_gain"),
    }
)


class BayesianMethod:
    """Estimator of walking, by the coupling of device and leg."""

    name = BAYESIAN
    kinds = ("walking",)

    def baseline_for(self, kind: StudyKind) -> str:  # noqa: ARG002 - the protocol's
        """Return ``predicted``."""
        return PREDICTED

    def estimate(self, data: ParticipantData, settings: ParticipantSettings) -> Estimates:
        """Estimate every timing point; with fewer sensors where all of them are unlikely."""
        participant, pulses = _prepared(data, settings)
        estimates = participant.estimates(pulses)
        for sensors in participant.fewer_sensors():
            other, pulses = _prepared(data, settings, sensors=sensors)
            fewer = other.estimates(pulses)
            if other.is_likely:
                return replace(fewer, notes=(*fewer.notes, participant.note_without(sensors)))
        return estimates

    def predicted_shapes(
        self, data: ParticipantData, settings: ParticipantSettings
    ) -> list[PredictedShapes]:
        """Return the pulses of every timing point as predicted, without an estimate."""
        participant, pulses = _prepared(data, settings)
        return participant.predicted_shapes(pulses)

    def leg_data(self, data: ParticipantData, settings: ParticipantSettings) -> "LegData":
        """Return what is fitted, without a fit; timing points that fail before it are left out."""
        participant, pulses = _prepared(data, settings)
        return participant.leg_data(pulses)


def _prepared(
    data: ParticipantData,
    settings: ParticipantSettings,
    *,
    sensors: tuple[str, ...] | None = None,
) -> tuple["_Participant", list[Candidate]]:
    """Return the estimator of a participant, of all sensors or some, and the pulses by point."""
    coupling = COUPLINGS[settings.coupling]
    longer = _with_all_data(settings, coupling)
    pulses = assign_pulses(data.participant, data.sources, longer, baseline=PREDICTED, alone=True)
    reach_s = longer.perturbations.window_s + _MARGIN_S
    predict = partial(CellPredictor, settings=longer, reach_s=reach_s)
    if not coupling.is_strap:
        # With an encoder beside the goniometer its fit was refused, or J 10 % too low.
        sensors = ()
    predictor = predict(data.sources, sensors=sensors)
    choice = predictor.choice
    if (gain := choice.goniometer_gain) is not None:
        sources = [with_goniometer_gain(source, gain) for source in data.sources]
        data = replace(data, sources=sources)
        predictor = predict(sources, sensors=choice.used if sensors is None else sensors)
    return _Participant(data, settings, predictor, choice, coupling), pulses


def _with_all_data(settings: ParticipantSettings, coupling: Coupling) -> ParticipantSettings:
    """Return settings whose window holds all data that are fitted."""
    reach_s = max(coupling.fit_s, settings.perturbations.window_s)
    longer = settings.perturbations.model_copy(update={"window_s": reach_s})
    return replace(settings, perturbations=longer)


@dataclass(frozen=True, slots=True, eq=False)
class LegData:
    """Timing points that are fitted together, with the model of their responses and its priors."""

    cells: tuple[PredictedCell, ...]
    model: LegModel
    priors: LegPriors
    body: Body
    known: CalibrationSpec


@dataclass(frozen=True, slots=True, eq=False)
class _Explained:
    """Timing points that were fitted together, and what they depend on."""

    cells: tuple[PredictedCell, ...]
    posterior: LegPosterior
    moments: LogMoments
    remaining: Mapping[str, np.ndarray]  # source -> sds of all logarithms if it were known
    body: Body
    known: CalibrationSpec
    instruments: tuple[UnlikelyParameter, ...]  # of instruments and reflex
    unlikely_lag: UnlikelyParameter | None  # where the responses contradict the calibrated lag
    # responses by shape with fit, and VAF (%), of each timing point
    fits: tuple[tuple[tuple[Response, ...], float], ...]
    unlike_size: bool  # whether the responses do not grow with the torque
    sensors_contradict: bool  # whether a sensor was left out, or trusted for less
    coupling: Coupling

    def doubts(self) -> tuple[set[Doubt], ...]:
        """Return what speaks against the model at each timing point."""
        of_person = {Doubt.LAG_UNLIKELY} if self.unlikely_lag else set()
        if self.unlike_size:
            of_person.add(Doubt.RESPONSES_UNLIKE_SIZE)
        if self.sensors_contradict:
            of_person.add(Doubt.SENSORS_CONTRADICT)
        of_points = doubts_of(
            self.posterior, self.moments, self.body, self.instruments, self.coupling
        )
        return tuple(doubts | of_person for doubts in of_points)

    @property
    def unlikely(self) -> tuple[UnlikelyParameter, ...]:
        """Parameters that speak against the model."""
        lag = [self.unlikely_lag] if self.unlikely_lag else []
        doubts = set[Doubt]().union(*self.doubts())
        return (*lag, *self.instruments, *unlikely_inertias(self.moments, self.body, doubts))


@dataclass(slots=True, eq=False)
class _Participant:
    """Estimates one participant's timing points."""

    _data: ParticipantData
    _settings: ParticipantSettings
    _predictor: CellPredictor
    _choice: SensorChoice
    _coupling: Coupling
    _fitted: _Explained | None = None

    @property
    def is_likely(self) -> bool:
        """True if the fitted model raises no doubt about sensors or device."""
        return self._fitted is not None and self._doubts() <= _HARMLESS

    def _doubts(self) -> set[Doubt]:
        return set().union(*self._fitted.doubts()) if self._fitted else set()

    def fewer_sensors(self) -> Iterator[tuple[str, ...]]:
        """Yield smaller sets of sensors to try where the model of all of them is unlikely.

        The goniometer alone cannot show its own errors: it is tried only where the sensors agree.
        """
        sensors = self._predictor.sensors
        against = self._doubts() - _HARMLESS
        if not (sensors and self._fitted and against and against <= _OF_SENSOR_MODEL):
            return
        if len(sensors) > 1:
            yield from ((name,) for name in sensors)
        if self._choice.closely and _OF_SENSORS.isdisjoint(
            parameter.name for parameter in self._fitted.instruments
        ):
            yield ()

    def note_without(self, sensors: Sequence[str]) -> str:
        """Return the note about estimates of fewer sensors."""
        names = [name for name in self._predictor.sensors if name not in sensors]
        unlikely = self._fitted.instruments if self._fitted else ()
        return (
            f"{self._data.participant}: the model of all sensors is unlikely "
            f"({'; '.join(map(str, unlikely)) or 'misfit'})"
            f"; without {' and '.join(names)} it is not, and values are from the others."
        )

    def estimates(self, candidates: Sequence[Candidate]) -> Estimates:
        """Return the estimates of all timing points, and all pulses with their final codes."""
        records, predicted, codes = self._predictor.predict_points(candidates)
        failures = self._failures(predicted)
        remaining = [c for c in predicted.values() if not failures[c.label]]
        try:
            explained = self._fitted = self._explained(remaining)
        except np.linalg.LinAlgError:
            explained = None
            failures |= {c.label: Failure.ILL_CONDITIONED for c in remaining}
        if explained is not None:
            failures |= _failures_after(explained)
        return self._assembled(records, codes, predicted, failures, explained)

    def leg_data(self, candidates: Sequence[Candidate]) -> LegData:
        """Return what is fitted of all timing points that do not fail before."""
        _, predicted, _ = self._predictor.predict_points(candidates)
        failures = self._failures(predicted)
        cells = [cell for cell in predicted.values() if not failures[cell.label]]
        if not cells:
            why = next(iter(failures.values()), None) or Failure.TOO_FEW_PULSES
            raise DataError(f"{self._data.participant}: {why.value}: {why.meaning}.")
        return self._leg_data(cells)

    def predicted_shapes(self, candidates: Sequence[Candidate]) -> list[PredictedShapes]:
        """Return the pulses of every timing point by shape, without an estimate."""
        _, predicted, _ = self._predictor.predict_points(candidates)
        points = []
        for cell in predicted.values():
            point = self._point(cell, self._known([cell]))
            shapes = np.full(len(cell.kept), -1)
            shapes[cell.kept] = np.argsort(point.by_frequency)[point.shape_of_pulse]
            points.append(PredictedShapes(cell, shapes))
        return points

    def _assembled(
        self,
        records: list[PulseRecord],
        codes: Mapping[str, list[str]],
        predicted: Mapping[str, PredictedCell],
        failures: Mapping[str, Failure | None],
        explained: _Explained | None,
    ) -> Estimates:
        places = {c.label: k for k, c in enumerate(explained.cells)} if explained else {}
        doubts = explained.doubts() if explained else ()
        cells = []
        for label, own in codes.items():
            failure = failures.get(label)
            if label in places and failure is None and explained is not None:
                k = places[label]
                cells.append(self._cell(k, explained, len(own), doubts[k]))
            else:
                cell = predicted.get(label)
                cells.append(self._failed(label, failure or failure_of_codes(own), cell, len(own)))
        posterior = None
        if explained is not None and not all(failures[c.label] for c in explained.cells):
            posterior = self._log_posterior(explained, doubts, failures)
        return Estimates(tuple(cells), records, notes=self._notes(), log_posterior=posterior)

    def _notes(self) -> tuple[str, ...]:
        """Name sensors that are not used, and parameters that speak against the model."""
        unlikely = self._fitted.unlikely if self._fitted else ()
        notes = (*self._choice.notes(), *(found.advice for found in unlikely))
        return tuple(f"{self._data.participant}: {note}" for note in notes)

    # --- before the fit ------------------------------------------------------------------------

    def _failures(self, cells: Mapping[str, PredictedCell]) -> dict[str, Failure | None]:
        if self._settings.perturbations.window_s > LONGEST_WINDOW_S + 1e-9:
            return dict.fromkeys(cells, Failure.WINDOW_TOO_LONG)
        if self._choice.disagree:
            return dict.fromkeys(cells, Failure.SENSORS_DISAGREE)
        failures = {label: self._failure(cell) for label, cell in cells.items()}
        return common_failure(failures) if failures else {}

    def _failure(self, cell: PredictedCell) -> Failure | None:
        if cell.label in self._predictor.points_without_response:
            return Failure.CONSTANT_ANGLE
        for index in dict.fromkeys(c.source for c in cell.used):
            recording = self._data.sources[index].input.recording
            pulses = [c.pulse for c in cell.used if c.source == index]
            if failure := angle_failure(recording) or torque_failure(recording, pulses):
                return failure
        size_nm = float(np.median(self._predictor.amplitudes_nm(cell.used)))
        if has_pulses_in_strides(cell.predicted, size_nm):
            return Failure.OUT_OF_STEP
        return response_failure(self._point(cell, self._known([cell])))

    def _known(self, cells: Sequence[PredictedCell]) -> CalibrationSpec:
        sources = [self._data.sources[c.source] for cell in cells for c in cell.used]
        return pooled_calibration([s.input.calibration for s in sources])

    def _point(self, cell: PredictedCell, known: CalibrationSpec) -> PointResponse:
        return point_response(
            cell,
            window_s=self._settings.perturbations.window_s,
            known=known,
            sensors=self._predictor.sensors,
            coupling=self._coupling,
        )

    # --- the fit -------------------------------------------------------------------------------

    def _leg_data(self, cells: Sequence[PredictedCell]) -> LegData:
        settings, known = self._settings, self._known(cells)
        coupling = self._coupling
        spec, of_body = coupling.spec(settings.priors), coupling.is_strap
        body = body_of(settings.person, settings.joint, spec, of_body=of_body)
        model = LegModel(
            [self._point(cell, known) for cell in cells],
            window_s=settings.perturbations.window_s,
            gravity_stiffness=body.gravity_stiffness,
            error=coupling.error,
        )
        used = dict.fromkeys(c.source for cell in cells for c in cell.used)
        sources = [self._data.sources[index] for index in used]
        priors = LegPriors(
            spec,
            body,
            instrument_priors(known, friction_of_model(sources), self._predictor.sensors),
            calibrated_lag(known),
            coupling,
        )
        return LegData(tuple(cells), model, priors, body, known)

    def _explained(self, cells: Sequence[PredictedCell]) -> _Explained | None:
        if not cells:
            return None
        data, last, coupling = self._leg_data(cells), self._settings.last_fit, self._coupling
        fit = explain if last is None else last.explain
        posterior = fit(data.model, data.priors)
        return _Explained(
            cells=data.cells,
            posterior=posterior,
            moments=log_moments(posterior),
            remaining=remaining_sds(posterior),
            body=data.body,
            known=data.known,
            instruments=unlikely_instruments(posterior, coupling.fixed),
            unlikely_lag=_unlikely_lag(data.model, data.priors, fit),
            fits=tuple(_fitted(posterior, k) for k in range(len(cells))),
            unlike_size=differs_with_size(posterior),
            sensors_contradict=bool(self._choice.odd)
            or self._choice.goniometer_gain is not None
            or (coupling.is_strap and set(self._predictor.sensors) < set(self._choice.used)),
            coupling=coupling,
        )

    # --- after the fit -------------------------------------------------------------------------

    def _cell(
        self, k: int, explained: _Explained, n_pulses: int, doubts: set[Doubt]
    ) -> CellEstimate:
        cell, point = explained.cells[k], explained.posterior.model.points[k]
        used = cell.used
        onset = mean_phase([c.record.measured_pct for c in used])
        window_s = self._settings.perturbations.window_s
        centre = None
        if onset is not None and np.isfinite(cell.stride_s):
            centre = (onset + 50.0 * window_s / cell.stride_s) % 100.0
        responses, vaf_pct = explained.fits[k]
        inside = point.time_s <= window_s
        moved = max(float(np.abs(s.sensor_signals[0, inside]).max()) for s in point.shapes)
        pushed = max(float(np.abs(s.torque[inside]).max()) for s in point.shapes)
        natural = pushed / max(moved, 1e-9)
        decision = replace(self._decision(cell, explained.known), natural_stiffness=natural)
        parameters = decided_rows(k, explained.moments, decision, doubts)
        return CellEstimate(
            participant=self._data.participant,
            timing_point=cell.label,
            onset_gait_pct=onset,
            parameters=parameters,
            vaf_pct=vaf_pct,
            n_used=len(used),
            n_excluded=n_pulses - len(used),
            method=BAYESIAN,
            baseline=PREDICTED,
            displacement_rad=moved,
            response=responses[0],
            other_shapes=responses[1:],
            nuisance=tuple(lags_of_instruments(explained.posterior, explained.known)),
            through_instruments=_through_sources(k, explained, parameters),
            centre_gait_pct=centre,
            gravity_corrected=self._gravity_corrected(cell, parameters[0], point, centre),
            example=self._example(cell, point, explained.known),
        )

    def _example(
        self, cell: PredictedCell, point: PointResponse, known: CalibrationSpec
    ) -> PulseExample:
        """Return a pulse of the most frequent shape; its response is as signed."""
        return self._predictor.example(
            cell,
            point.shape_of_pulse == point.by_frequency[0],
            n=point.time_s.size,
            response_of=lambda response: corrected(response, cell.period_s, known)[0],
        )

    def _gravity_corrected(
        self,
        cell: PredictedCell,
        stiffness: ParameterEstimate,
        point: PointResponse,
        centre: float | None,
    ) -> ParameterEstimate | None:
        """Return the stiffness without gravity's part, if limb and posture are known."""
        inside = point.time_s <= self._settings.perturbations.window_s
        moved_rad = float(np.mean([s.sensor_signals[0, inside].mean() for s in point.shapes]))
        return participant_stiffness_without_gravity(
            stiffness,
            self._settings,
            angle_rad=cell.predicted.posture_rad + moved_rad,
            gait_pct=centre,
            known=self._known([cell]),
        )

    def _decision(self, cell: PredictedCell, known: CalibrationSpec) -> Decision:
        recording = self._data.sources[cell.used[0].source].input.recording
        return Decision(
            known=known,
            mass_kg=self._settings.mass_kg,
            subtract=intrinsic_left_in(recording),
            several_sensors=bool(self._predictor.sensors),
            by_person=self._coupling.is_strap,
        )

    def _log_posterior(
        self,
        explained: _Explained,
        doubts: Sequence[set[Doubt]],
        failures: Mapping[str, Failure | None],
    ) -> LogPosterior:
        n, moments = len(explained.cells), explained.moments
        decision = self._decision(explained.cells[0], explained.known)
        ordered = dict.fromkeys(code.value for codes in doubts for code in sorted(codes))
        return LogPosterior(
            participant=self._data.participant,
            parameters=tuple(name for name in ESTIMANDS for _ in range(n)),
            timing_points=tuple(c.label for _ in ESTIMANDS for c in explained.cells),
            mean=moments.mean,
            covariance=moments.covariance,
            prior_mean=moments.prior_mean,
            prior_covariance=moments.prior_covariance,
            doubts=tuple(ordered),
            unlikely=explained.unlikely,
            doubted=tuple(
                bool(failures[cell.label]) or rejects_value(name, codes) or only_limits(name, codes)
                for name in ESTIMANDS
                for cell, codes in zip(explained.cells, doubts, strict=True)
            ),
            intrinsic=tuple((name, decision.intrinsic(name)[0]) for name in ESTIMANDS),
            gain_sd=decision.gain_sd,
            scale_units=tuple((n, u) for n in ESTIMANDS if (u := moments.scale(n).unit)),
        )

    def _failed(
        self, label: str, failure: Failure, cell: PredictedCell | None, n_pulses: int
    ) -> CellEstimate:
        used = [] if cell is None else cell.used
        return failed_cell(
            failure,
            self._settings,
            participant=self._data.participant,
            timing_point=label,
            counts=(len(used), n_pulses - len(used)),
            method=BAYESIAN,
            baseline=PREDICTED,
            onset_gait_pct=mean_phase([c.record.measured_pct for c in used]),
        )


def _unlikely_lag(
    model: LegModel, priors: LegPriors, fit: Callable[[LegModel, LegPriors], LegPosterior]
) -> UnlikelyParameter | None:
    if priors.lag is None:
        return None
    return unlikely_lag(fit(model, replace(priors, lag=None)), priors.lag)


def _failures_after(explained: _Explained) -> dict[str, Failure | None]:
    """Return why fitted timing points have no estimate; values beyond any joint fail one by one."""
    late = lag_failure(explained.posterior)
    failures: dict[str, Failure | None] = {}
    for k, cell in enumerate(explained.cells):
        beyond = any(
            explained.moments.value(name, k) > largest
            for name, largest in zip(PARAMETERS, LARGEST_IMPEDANCE, strict=True)
        )
        _, vaf_pct = explained.fits[k]
        misfit = Failure.MODEL_MISFIT if vaf_pct < _LEAST_VAF_PCT else None
        failures[cell.label] = late or misfit or (Failure.OUTSIDE_RANGE if beyond else None)
    return failures


def _fitted(posterior: LegPosterior, k: int) -> tuple[tuple[Response, ...], float]:
    """Return the response of each shape with its fit, the most frequent first, and VAF (%)."""
    point, model = posterior.model.points[k], posterior.model
    fits = _goniometer(posterior, k)
    measured = np.stack([s.sensor_signals[0] for s in point.shapes])
    used = np.stack([s.used for s in point.shapes])
    residual = float(((measured - fits)[used] ** 2).sum() / (measured[used] ** 2).sum())
    within = point.time_s <= model.window_s + 1e-9
    responses = tuple(
        _response(point.time_s, point.shapes[shape], fits[shape], within)
        for shape in point.by_frequency
    )
    return responses, 100.0 * (1.0 - residual)


def _response(
    time_s: np.ndarray, shape: ShapeAverage, fitted: np.ndarray, within: np.ndarray
) -> Response:
    inside = within & shape.used
    return Response(
        time_s=time_s[inside],
        angle=shape.sensor_signals[0][inside],
        torque=shape.torque[inside],
        fitted_torque=shape.torque[inside],
        fitted_angle=fitted[inside],
        n_pulses=int(shape.n_pulses),
    )


def _goniometer(posterior: LegPosterior, k: int) -> np.ndarray:
    """Return the fitted angle of each shape, (shape, n) rad."""
    point = posterior.model.points[k]
    modelled = posterior.model.responses(posterior.best.theta[None], k)[0]
    return np.asarray(modelled.reshape(len(point.shapes), len(point.channels), -1)[:, 0])


def _through_sources(
    k: int, explained: _Explained, parameters: Sequence[ParameterEstimate]
) -> dict[str, dict[str, float]]:
    """Return the part of each error, SI, that would vanish if a source were known."""
    n, sds, values = len(explained.cells), explained.moments.sd, {p.name: p for p in parameters}
    parts: dict[str, dict[str, float]] = {}
    for place, name in enumerate(ESTIMANDS):
        at, value = place * n + k, values[name].unbounded
        scale = explained.moments.scale(name)
        if value is not None and (value > 0.0 or scale.unit) and np.isfinite(sds[at]):
            parts[name] = {
                source: float(scale.slope(value))
                * float(np.sqrt(max(sds[at] ** 2 - left[at] ** 2, 0.0)))
                for source, left in explained.remaining.items()
            }
    return parts
