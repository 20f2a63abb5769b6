"""Timing points with predicted pulses, and a code for each pulse that cannot be used."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.codes import Exclusion
from jointz.core.events import PulseRecord
from jointz.core.gait_phases import mean_phase
from jointz.identify.prediction.pulse_checks import copied_pulses, ineffective_pulses
from jointz.identify.prediction.pulse_shapes import pulse_shapes
from jointz.identify.prediction.unperturbed_prediction import (
    FEWEST_STRIDES,
    LEAD_SAMPLES,
    Predicted,
    UnperturbedPredictor,
    join_predictions,
    quiet_strides,
)
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.cell_data import dead_signals
from jointz.identify.preparation.conditioning import Conditioned
from jointz.identify.preparation.raw_signals import (
    RAW_ANGLE,
    TORQUE_ROWS,
    common_rate_hz,
    raw_signals,
)
from jointz.identify.preparation.sensor_agreement import choose_sensors
from jointz.identify.preparation.sources import ParticipantSettings, Source, most_alike
from jointz.kernels.robust_spread import robust_moments, robust_sd
from jointz.results.estimates import PulseExample

#: If more than this share of the pulses did not reach the joint, the others did not in full.
_MOST_UNFELT = 0.3
#: Smallest error of an angle (0.01 degrees), of measurement and of the model.
FINEST_RAD = 2e-4
#: Responses further from the others, in sds of the prediction error, are excluded.
_UNLIKE_SD = 8.0
_FEWEST_TO_COMPARE = 4


@dataclass(frozen=True, slots=True, eq=False)
class PredictedCell:
    """A timing point with predicted pulses."""

    label: str  # name of the timing point
    candidates: list[Candidate]  # pulses of the timing point
    predicted: Predicted  # responses of the pulses, and errors of the prediction
    kept: np.ndarray  # bool, one for each response: whether it is used
    period_s: float  # between samples
    phase: float  # mean predicted phase of the onsets, cycles; NaN where unknown
    stride_s: float  # duration of a stride

    @property
    def answered(self) -> list[Candidate]:
        """Pulses with a response, one for each of ``predicted.responses``."""
        codes = self.predicted.codes
        return [c for c, code in zip(self.candidates, codes, strict=True) if not code]

    @property
    def used(self) -> list[Candidate]:
        """Pulses whose responses are used."""
        return [c for c, keep in zip(self.answered, self.kept, strict=True) if keep]


@dataclass(frozen=True, slots=True, eq=False)
class PredictedShapes:
    """Pulses of a timing point by shape, before anything is fitted."""

    cell: PredictedCell
    # (pulse,) place of each predicted pulse's shape in the responses of the estimate; -1 if the
    # pulse is not averaged
    shapes: np.ndarray


def example_place(responses: np.ndarray) -> int:
    """Return the pulse whose response (pulse, n) has the median distance from their average."""
    distances = ((responses - responses.mean(axis=0)) ** 2).sum(axis=1)
    return int(np.argsort(distances)[len(distances) // 2])


def recorded_pulse(
    candidate: Candidate, response: np.ndarray, signals: Conditioned, period_s: float
) -> dict[str, np.ndarray]:
    """Return time from the onset, angle and torque as recorded and their baselines, by name.

    ``response`` (rows, n) is that of the pulse: recorded minus predicted.
    """
    n = response.shape[1]
    begin = np.array([candidate.pulse.onset_s - LEAD_SAMPLES * period_s])
    cut, _ = signals.cut(begin, before_s=0.0, after_s=n * period_s)
    angle, torque = cut[0, RAW_ANGLE], cut[0, TORQUE_ROWS].sum(axis=0)
    return {
        "time_s": (np.arange(n) - LEAD_SAMPLES) * period_s,
        "angle": angle,
        "torque": torque,
        "baseline_angle": angle - response[0],
        "baseline_torque": torque - response[TORQUE_ROWS].sum(axis=0),
    }


class CellPredictor:
    """Predicts the pulses of a participant's timing points, with one predictor a recording.

    All ``sensors`` of the device's motion and the leg's are predicted; without them, those that
    agree.
    """

    def __init__(
        self,
        sources: Sequence[Source],
        settings: ParticipantSettings,
        *,
        reach_s: float,
        sensors: Sequence[str] | None = None,
    ) -> None:
        self._sources = sources
        self._settings = settings
        self._reach_s = reach_s  # from the onset to the end of the predicted windows
        self._predictors: dict[int, UnperturbedPredictor] = {}
        self._by_torque = settings.perturbations.source not in ("angle", "reference")
        self.choice = choose_sensors(self._needed())
        self.sensors = self.choice.used if sensors is None else tuple(sensors)
        # timing points whose pulses did not reach the joint
        self.points_without_response: set[str] = set()

    def predict_points(
        self, candidates: Sequence[Candidate]
    ) -> tuple[list[PulseRecord], dict[str, PredictedCell], dict[str, list[str]]]:
        """Return all pulses with their final codes; by timing point, the prediction and codes."""
        records = [c.record for c in candidates]
        predicted: dict[str, PredictedCell] = {}
        codes: dict[str, list[str]] = {}
        for label, indices in pulses_by_point(records, self._settings).items():
            cell, codes[label] = self.predict(label, [candidates[k] for k in indices])
            if cell is not None:
                predicted[label] = cell
            for k, code in zip(indices, codes[label], strict=True):
                records[k] = replace(records[k], code=code)
        return records, predicted, codes

    def predict(
        self, label: str, candidates: Sequence[Candidate]
    ) -> tuple[PredictedCell | None, list[str]]:
        """Predict the pulses of a timing point; return None without any, and all codes."""
        codes = [c.record.code for c in candidates]
        parts: list[tuple[list[int], Predicted]] = []
        for index in dict.fromkeys(c.source for c in candidates):
            usable = [k for k, c in enumerate(candidates) if c.source == index and not codes[k]]
            usable = self._alive(index, usable, candidates, codes)
            if not usable:
                continue
            part = self._predictor(index).predict([candidates[k] for k in usable])
            for k, code in zip(usable, part.codes, strict=True):
                codes[k] = code
            parts.append((usable, part))
        if not any(len(part.responses) for _, part in parts):
            return None, codes
        order = [k for usable, _ in parts for k in usable]
        ordered = [candidates[k] for k in order]
        joined = join_predictions([part for _, part in parts])
        predicted = [k for k, code in zip(order, joined.codes, strict=True) if not code]
        checked = self._checked(joined, [candidates[k] for k in predicted])
        if checked.count(Exclusion.NO_RESPONSE.value) > _MOST_UNFELT * len(checked):
            self.points_without_response.add(label)
        for k, code in zip(predicted, checked, strict=True):
            codes[k] = code
        kept = np.array([not code for code in checked], dtype=bool)
        if not kept.any():
            return None, codes
        strides = self._sources[ordered[0].source].strides
        phase = mean_phase([c.predicted_pct for c in ordered])
        cell = PredictedCell(
            label=label,
            candidates=ordered,
            predicted=joined,
            kept=kept,
            period_s=1.0 / self._predictor(ordered[0].source).rate_hz,
            phase=np.nan if phase is None else phase / 100.0,
            stride_s=float(np.median(strides.duration_s)) if strides is not None else np.nan,
        )
        return cell, codes

    def example(
        self,
        cell: PredictedCell,
        chosen: np.ndarray,
        *,
        n: int,
        response_of: Callable[[np.ndarray], np.ndarray],
    ) -> PulseExample:
        """Return n samples of one of the chosen pulses that are used.

        ``response_of`` returns the response as it is averaged from that of all signals, (rows, n).
        """
        places = np.flatnonzero(chosen)
        responses = cell.predicted.responses[cell.kept][places, :, :n]
        best = example_place(responses[:, 0])
        candidate, response = cell.used[places[best]], responses[best]
        signals = self._predictor(candidate.source).signals
        return PulseExample(
            recording=candidate.record.recording,
            onset_s=candidate.pulse.onset_s,
            **recorded_pulse(candidate, response, signals, cell.period_s),
            response=response_of(response),
            n_averaged=len(places),
        )

    def _checked(self, predicted: Predicted, candidates: Sequence[Candidate]) -> list[str]:
        """Return a code for every predicted pulse, "" for those that can be used."""
        torque = predicted.responses[:, TORQUE_ROWS].sum(axis=1)
        shapes = pulse_shapes(torque, [c.pulse for c in candidates])
        # A pulse without torque is of no shape: it is compared with all others.
        no_torque = Exclusion.NO_TORQUE.value
        ineffective = ineffective_pulses(predicted, self.amplitudes_nm(candidates))
        codes = np.array([code if code == no_torque else "" for code in ineffective], dtype=object)
        shapes = np.where(codes == "", shapes, -1)
        for shape in np.unique(shapes[shapes >= 0]):
            members = np.flatnonzero(shapes == shape)
            part = predicted.of(members)
            pulses_of_shape = [c for c, s in zip(candidates, shapes, strict=True) if s == shape]
            ineffective = ineffective_pulses(part, self.amplitudes_nm(pulses_of_shape))
            kept = alike(part, whole=np.array([not code for code in ineffective], dtype=bool))
            unusual = Exclusion.UNUSUAL_RESPONSE.value
            codes[members] = [
                code or ("" if keep else unusual)
                for code, keep in zip(ineffective, kept, strict=True)
            ]
        return [str(code) for code in codes]

    def amplitudes_nm(self, candidates: Sequence[Candidate]) -> np.ndarray:
        """Return the commanded amplitudes, N*m; NaN if pulses are read off a motion."""
        if not self._by_torque:
            return np.full(len(candidates), np.nan)
        return np.array([abs(c.pulse.amplitude) for c in candidates])

    def _alive(
        self, index: int, usable: list[int], candidates: Sequence[Candidate], codes: list[str]
    ) -> list[int]:
        """Code pulses with a constant signal, and copies; return the others."""
        if not usable:
            return usable
        pulses = [candidates[k].pulse for k in usable]
        source, window_s = self._sources[index], self._settings.perturbations.window_s
        windows, _ = source.signals.cut(
            np.array([p.onset_s for p in pulses]), before_s=0.0, after_s=window_s
        )
        copies = copied_pulses(source.input.recording, pulses, window_s=window_s)
        for k, dead, copy in zip(usable, dead_signals(windows), copies, strict=True):
            codes[k] = dead or (Exclusion.COPIED_PULSE.value if copy else "")
        return [k for k in usable if not codes[k]]

    def _predictor(self, index: int) -> UnperturbedPredictor:
        if index not in self._predictors:
            source, rate = self._sources[index], common_rate_hz(self._sources)
            taught_by = [source, *self._training_sources(source)]
            signals = [raw_signals(s, target_hz=rate, sensors=self.sensors) for s in taught_by]
            lessons = list(zip(taught_by, signals, strict=True))
            self._predictors[index] = UnperturbedPredictor(
                *lessons[0], window_s=self._reach_s, others=lessons[1:], sensors=self.sensors
            )
        return self._predictors[index]

    def _needed(self) -> list[Source]:
        """Return the recordings with pulses, and what they learn from."""
        pulsed = [s for s in self._sources if s.input.condition == "perturbed"]
        teachers = [t for s in pulsed for t in self._training_sources(s)]
        return list({id(s): s for s in (*pulsed, *teachers)}.values())

    def _training_sources(self, source: Source) -> list[Source]:
        """Return what else to learn from if a recording has too few quiet strides."""
        if quiet_strides(source).size >= FEWEST_STRIDES:
            return []
        unperturbed = [s for s in self._sources if s.input.condition == "unperturbed"]
        keys = self._settings.kind.reference_keys
        nearest = most_alike(source.input, [s.input for s in unperturbed], keys=keys)
        return [s for s in unperturbed if any(s.input is r for r in nearest)]


def pulses_by_point(
    records: Sequence[PulseRecord], settings: ParticipantSettings
) -> dict[str, list[int]]:
    """Return the indices of the pulses of each timing point, in the order of the cycle.

    Groups, which have no place in the cycle, follow by name.
    """
    points = settings.timing_points
    labels = {r.timing_point for r in records if r.timing_point}
    return {
        label: [k for k, r in enumerate(records) if r.timing_point == label]
        for label in sorted(labels, key=lambda label: (points.get(label, 100.0), label))
    }


def alike(predicted: Predicted, *, whole: np.ndarray) -> np.ndarray:
    """Return which of the ``whole`` responses resemble each other, by the prediction error.

    They are compared with the median response per torque: a pulse of twice the torque moves the
    joint twice as far.
    """
    angles = predicted.responses[:, 0]
    if whole.sum() < _FEWEST_TO_COMPARE:
        return whole
    torque = predicted.responses[:, TORQUE_ROWS].sum(axis=1)
    shape = torque[whole].mean(axis=0)
    size = torque @ shape / (shape @ shape)
    usual, _ = robust_moments(angles[whole] / size[whole, None])
    off = np.abs(angles - size[:, None] * usual)
    limit = _UNLIKE_SD * np.hypot(robust_sd(predicted.prediction_errors[:, 0]), FINEST_RAD)
    return np.asarray(whole & (off <= limit).all(axis=1))
