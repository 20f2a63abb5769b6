"""Plan of an experiment from a lab, a schedule and wishes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import chain
from math import radians

import numpy as np

from jointz.core.errors import DataError
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import ExpectedJoint
from jointz.core.provenance import now, software
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.planning import pulse_choice
from jointz.planning.laboratory import SENSORS, Laboratory
from jointz.planning.plan_result import (
    LETTERS,
    Plan,
    PlannedEstimate,
    PlannedMeasure,
    PlannedPeople,
    PlannedShape,
)
from jointz.planning.predicted_additions import addition_notes
from jointz.planning.predicted_estimates import (
    ENDLESS,
    LegEstimates,
    PlannedLeg,
    drawn_parameters,
    typical_leg,
)
from jointz.planning.predicted_responses import Design
from jointz.planning.protocol_file import problems_of, protocol_text
from jointz.planning.pulse_numbers import (
    MOST,
    HalfWidths,
    expected_people,
    half_widths,
    people_rows,
)
from jointz.planning.schedule import Schedule
from jointz.planning.wishes import (
    MOST_DIFFERENCE_PCT,
    MOST_MEAN_PCT,
    MOST_MINUTES,
    MOST_PEOPLE,
    Wishes,
    rounded_up,
)
from jointz.report.wording import format_count
from jointz.results.estimates import WIDEST
from jointz.stats.expected_people import ExpectedPeople

#: Legs drawn from the priors.
LEGS = 10
#: Pulses of a timing point at which shapes are compared.
_COMPARED = 48
_PEOPLE = (4, 6, 8, 10, 12, 16, 20, 30, 40)
#: The protocol's own pulses stay if others are better by no more than this.
_MOST_OWN_WORSE = 1.02
#: Motion over its limit up to which pulses are accepted.
_MOTION_MARGIN = 1.02
#: Penalty of pulses that decide nothing: they are chosen only if no others are possible.
_UNDECIDED = 10.0
#: Numbers of pulses are interpolated: a wish is kept with a margin.
_SURELY = 0.98
#: Larger differences are only called large.
_LARGEST_NAMED_PCT = 200.0
#: Motion that cuts a pulse, over that of nine of ten legs. Three SDs of the error of the gate,
#: which predicts the unperturbed angle 63 ms ahead, rad.
_TRIPS, _GATE_ERROR_RAD = 1.2, 0.06
#: Legs from which aborted pulses are predicted: few legs have most of them.
_ABORTING_LEGS = 60
#: Share of aborted pulses from which a remedy is named.
_MANY_ABORTED = 0.05


class Planner:
    """The steps of a plan."""

    def __init__(
        self,
        schedule: Schedule,
        lab: Laboratory,
        wishes: Wishes,
        *,
        walking: str,
        seed: int,
        tell: Callable[[str], None],
    ) -> None:
        self._schedule, self._lab, self._wishes, self._walking = schedule, lab, wishes, walking
        self._seed, self._tell = seed, tell
        self._points = schedule.timing_points
        self._refused: list[str] = []
        self._notes: list[str] = []
        self._sensors = tuple(n for n in SENSORS if n in lab.noise)
        self._wanted = [PARAMETERS.index(name) for name in wishes.parameters]
        trips_deg = np.degrees(schedule.displacement_rad or np.inf)
        # Motion beyond the protocol's own limit would trip the device.
        self._motion_deg = float(min(wishes.motion_deg, trips_deg))
        self._limit_rad = schedule.displacement_rad
        if self._limit_rad is not None:
            trips = round(_TRIPS * radians(self._motion_deg) + _GATE_ERROR_RAD, 3)
            self._limit_rad = min(self._limit_rad, trips)
        if not lab.coupling.is_strap:
            self._notes.append('The device moves with the bone: coupling = "rigid".')
        if schedule.asked_window_s > schedule.design.window_s:
            self._notes.append(
                f"The window of {1000.0 * schedule.asked_window_s:.0f} ms was shortened to "
                f"{1000.0 * schedule.design.window_s:.0f} ms, the longest of the method."
            )

    def plan(self, spec: Protocol | None) -> Plan:
        """Return the plan; without a protocol, what a recorded study could see."""
        own = self._schedule.design
        legs = drawn_parameters(self._lab, own, n=LEGS, seed=self._seed)
        design, middle, shapes = self._chosen(own, legs, fixed=spec is None)
        self._tell("shapes")
        widths = half_widths(self._lab, design, middle, legs, tell=lambda: self._tell("legs"))
        counts = self._counts(widths)
        typical = middle.estimates(_float(counts))
        estimates = self._estimates(middle, typical, widths, counts)
        self._tell("timing points")
        known = middle.if_known(_float(counts))
        measures = tuple(self._measures(design, middle, counts, known))
        self._tell("sensors")
        people, participants = self._people(typical)
        minutes = self.minutes(counts)
        self._note_undecidable_values(estimates)
        if spec is None:
            self._note_undetectable_differences(people, participants)
        if spec is not None and spec.condition_loads:
            perturbed = [c for c in spec.conditions if c.perturbations is not None]
            loaded = sum(c.load is not None for c in perturbed)
            pairs = max(min(loaded, len(perturbed) - loaded), 1)
            each = {name: float(pairs * n) for name, n in counts.items()}
            self._notes += addition_notes(self._lab, design, each, spec.loads)
        text, aborted = "", None
        if spec is not None and not self._refused:
            aborted = self._aborted(design, spec.expected_joint)
            text = self._protocol(spec, design, counts, estimates, participants)
        self._tell("protocol")
        return Plan(
            protocol=self._schedule.name,
            pulses=pulse_choice.text_of(design.pulses),
            window_s=design.window_s,
            sensors=self._sensors,
            walking=self._walking,
            estimates=tuple(estimates),
            shapes=tuple(shapes),
            measures=measures,
            people=people,
            participants=participants,
            minutes=minutes,
            peak_deg=next(s.peak_deg for s in shapes if s.chosen),
            wishes={k: v for k, v in asdict(self._wishes).items() if v is not None},
            refused=tuple(self._refused),
            notes=tuple(self._notes),
            sources=_sources(middle, _float(counts), known),
            courses=tuple(pulse_choice.planned_course(pulse) for pulse in design.pulses),
            recorded=spec is None,
            aborted_share=aborted,
            protocol_text=text,
            provenance={"software": software(), "created": now(), "seed": self._seed, "legs": LEGS},
        )

    # --- shapes --------------------------------------------------------------------------------

    def _chosen(
        self, own: Design, legs: Sequence[np.ndarray], *, fixed: bool
    ) -> tuple[Design, PlannedLeg, list[PlannedShape]]:
        """Return the best design within the limits, its typical leg, and all that were compared."""
        motion_rad = radians(self._motion_deg)
        compared = [own, *pulse_choice.candidates(self._lab, legs, own.window_s, motion_rad)]
        typical = [typical_leg(self._lab, design) for design in compared]
        results = [
            self._compared(design, leg, pulse_choice.peak_rad(self._lab, legs, design))
            for design, leg in zip(compared, typical, strict=True)
        ]
        rows, scores = [row for row, _ in results], [score for _, score in results]
        if not fixed and not np.isfinite(scores).any():
            raise DataError(
                "plan: no pulse of at least 1 N*m that the device can give stays below "
                f"{self._motion_deg:.3g} degrees in nine of ten legs. "
                f"Nearest: {self._nearest_pulses(own, legs)}."
            )
        # The lab's own pulses stay where others are not better.
        best = int(np.argmin(scores))
        if fixed or scores[0] <= scores[best] + np.log(_MOST_OWN_WORSE):
            best = 0
        rows[best] = replace(rows[best], chosen=True)
        if best:
            self._notes.append(_replaced(rows[0], rows[best]))
        return compared[best], typical[best], rows

    def _nearest_pulses(self, own: Design, legs: Sequence[np.ndarray]) -> str:
        """Return the torque or motion that allows the smallest pulses."""
        if self._lab.actuator.torque_nm < pulse_choice.LEAST_NM:
            return f"--torque {pulse_choice.LEAST_NM:g}"
        motion = self._motion_deg
        while not any(pulse_choice.candidates(self._lab, legs, own.window_s, radians(motion))):
            motion = rounded_up(1.01 * motion)
        return f"--motion {motion:g}"

    def _compared(self, design: Design, leg: PlannedLeg, peak: float) -> tuple[PlannedShape, float]:
        """Return the half-widths of a design and its score: lower is better, inf is impossible."""
        half = leg.estimates(dict.fromkeys(self._points, float(_COMPARED)))
        beyond = self._beyond_limits(design, peak)
        score = float(np.log(half.half_width[self._wanted]).mean())
        undecided = ""
        if not half.decided[self._wanted].any():
            endless = leg.estimates(dict.fromkeys(self._points, ENDLESS))
            never = not endless.decided[self._wanted].any()
            pulses = "however many there are" if never else f"with {_COMPARED} pulses"
            undecided = f"decides nothing that was asked for, {pulses}"
            score += _UNDECIDED
        stiffness, damping, inertia = (100.0 * np.median(half.half_width, axis=1)).tolist()
        row = PlannedShape(
            name=design.name,
            text=pulse_choice.text_of(design.pulses),
            peak_deg=float(np.degrees(peak)),
            stiffness_pct=stiffness,
            damping_pct=damping,
            inertia_pct=inertia,
            why_not=beyond or undecided,
        )
        return row, np.inf if beyond else score

    def _beyond_limits(self, design: Design, peak: float) -> str:
        """Return which limit a design exceeds; "" if none."""
        limit_deg = self._motion_deg
        if np.degrees(peak) > _MOTION_MARGIN * limit_deg:
            return f"moves the joint further than {limit_deg:.3g} degrees"
        largest = max(size for pulse in design.pulses for size in pulse.sizes_nm)
        if largest > self._lab.actuator.torque_nm + 1e-9:
            return f"needs {largest:g} N*m"
        return ""

    # --- numbers of pulses ---------------------------------------------------------------------

    def minutes(self, counts: Mapping[str, int]) -> float:
        """Return the walking of a participant, min."""
        stride_s = float(np.mean([p.stride_s for p in self._lab.walking[0].values()]))
        return self._schedule.strides(counts) * stride_s / 60.0

    def _fits(self, counts: Mapping[str, int]) -> bool:
        minutes = self._wishes.minutes
        return minutes is None or self.minutes(counts) <= minutes

    def _counts(self, widths: HalfWidths) -> dict[str, int]:
        """Return the pulses of every timing point, the nearest ones where wishes are refused."""
        wish, share = self._wishes.half_width_pct, self._wishes.share
        if wish is None and self._wishes.minutes is None:
            return dict(self._schedule.counts)
        precise, narrowest = widths.most_precise(self._wanted, share, self._fits)
        counts, nearest = precise, self._nearest_half_width(widths, narrowest)
        if wish is not None:
            counts = widths.fewest(self._wanted, share, _SURELY * wish / 100.0)
        if unreachable := [name for name in self._points if name not in counts]:
            self._refuse_half_width(widths, unreachable, nearest)
            counts = precise
        if not self._fits(counts) and not (unreachable and "--minutes" in nearest):
            self._refuse_minutes(counts, nearest if self._fits(precise) else "")
            return precise
        return counts

    def _nearest_half_width(self, widths: HalfWidths, narrowest: float) -> str:
        """Return how the narrowest half-width is asked for, or what decides the values at all."""
        if (nearest := rounded_up(100.0 * narrowest / _SURELY)) <= 100.0 * WIDEST:
            return f"--half-width {nearest:g}"
        counts = widths.fewest(self._wanted, self._wishes.share, _SURELY * WIDEST)
        minutes = rounded_up(self.minutes(counts)) if counts else 0.0
        if len(counts) == len(self._points) and minutes <= MOST_MINUTES:
            return f"--half-width {100.0 * WIDEST:g} --minutes {minutes:g}"
        return (
            "more --motion, --torque or sensors, a smaller --share, or other timing points "
            f"(beyond {100.0 * WIDEST:.0f} % a value is undecided)"
        )

    def _refuse_half_width(self, widths: HalfWidths, points: Sequence[str], nearest: str) -> None:
        wish, share = self._wishes.half_width_pct, self._wishes.share
        letters = " and ".join(LETTERS[name] for name in self._wishes.parameters)
        endless = 100.0 * widths.assured(ENDLESS, share)[self._wanted].max(axis=0)
        never = [p for p, pct in zip(self._points, endless, strict=True) if pct > (wish or 0.0)]
        text = (
            f"{letters} to {wish:g} % in {100 * share:.0f} of 100 legs cannot be had with {MOST} "
            f"pulses at {', '.join(points)}"
        )
        if never:
            which = "any of them" if never == list(points) else ", ".join(never)
            text += f", nor with more pulses at {which}"
        self._refused.append(f"{text}. Nearest: {nearest}.")

    def _refuse_minutes(self, counts: Mapping[str, int], other: str = "") -> None:
        """Refuse the minutes, which do not hold so many pulses; ``other`` is another remedy."""
        need = rounded_up(self.minutes(counts))
        longer = f"--minutes {need:g}" if need <= MOST_MINUTES else ""
        nearest = ", or ".join(remedy for remedy in (longer, other) if remedy)
        pulses = format_count(sum(counts.values()), "pulse")
        self._refused.append(
            f"{pulses} at {format_count(len(counts), 'timing point')} need {need:g} min of walking,"
            f" and there are {self._wishes.minutes:g} min. Nearest: "
            f"{nearest or 'fewer timing points'}."
        )

    # --- what is expected ----------------------------------------------------------------------

    def _estimates(
        self,
        middle: PlannedLeg,
        typical: LegEstimates,
        widths: HalfWidths,
        counts: Mapping[str, int],
    ) -> list[PlannedEstimate]:
        endless = middle.estimates(dict.fromkeys(self._points, ENDLESS))
        bias = middle.reflex_bias(_float(counts))
        legs = widths.of_legs(_float(counts))
        over = [leg.half_width / typical.half_width for leg in legs]
        ratio = np.quantile(np.concatenate(over, axis=1), self._wishes.share, axis=1)
        assured = typical.half_width * ratio[:, None]
        decided = np.mean([leg.decided for leg in legs], axis=0)
        return [
            PlannedEstimate(
                timing_point=name,
                gait_pct=pct,
                parameter=parameter,
                pulses=counts[name],
                half_width_pct=100.0 * float(typical.half_width[i, k]),
                assured_pct=100.0 * float(assured[i, k]),
                decided_share=float(decided[i, k]),
                endless_pct=100.0 * float(endless.half_width[i, k]),
                decidable=bool(endless.decided[i, k]),
                reflex_bias_pct=100.0 * float(bias[i, k]),
            )
            for k, (name, pct) in enumerate(self._points.items())
            for i, parameter in enumerate(PARAMETERS)
        ]

    def _note_undecidable_values(self, estimates: Sequence[PlannedEstimate]) -> None:
        for parameter in PARAMETERS:
            never = [
                e.timing_point for e in estimates if e.parameter == parameter and not e.decidable
            ]
            if never:
                self._notes.append(
                    f"No number of pulses decides {LETTERS[parameter]} of a typical leg at "
                    f"{', '.join(never)} with these pulses and sensors."
                )

    def _note_undetectable_differences(
        self, people: Sequence[PlannedPeople], participants: int
    ) -> None:
        """Note the smallest differences that a recorded study of so many people can find."""
        rows = [p for p in people if p.participants == participants]
        if rows:
            paired, groups = (
                ", ".join(f"{_size(getattr(p, key))} in {LETTERS[p.parameter]}" for p in rows)
                for key in ("paired_pct", "groups_pct")
            )
            self._notes.append(
                f"The smallest differences that {participants} participants find in "
                f"{100.0 * self._wishes.share:.0f} of 100 studies: between two conditions "
                f"{paired}; between two groups of so many {groups}."
            )

    def _measures(
        self,
        design: Design,
        middle: PlannedLeg,
        counts: Mapping[str, int],
        known: Mapping[str, np.ndarray],
    ) -> list[PlannedMeasure]:
        """Return half-widths with other sensors and calibrations, and with twice the pulses."""
        here = self._sensors
        rows = [_measure("as above", middle.estimates(_float(counts)).half_width)]
        for names in _sensor_sets(here):
            leg = typical_leg(self._lab.with_sensors(dict.fromkeys(names)), design)
            added = [n for n in names if n not in here]
            gone = [n for n in here if n not in names]
            what = f"with {' and '.join(added)}" if added else f"without {' and '.join(gone)}"
            rows.append(_measure(what, leg.estimates(_float(counts)).half_width))
        twice = {name: 2.0 * n for name, n in counts.items()}
        rows.append(_measure("with twice the pulses", middle.estimates(twice).half_width))
        return rows + [_measure(f"{what} known exactly", half) for what, half in known.items()]

    # --- people --------------------------------------------------------------------------------

    def _people(self, typical: LegEstimates) -> tuple[tuple[PlannedPeople, ...], int]:
        expected = expected_people(typical.moments, typical.decided, self._lab.decision.gain_sd)
        asked = self._wishes.participants
        participants = asked or self._schedule.participants
        wishes = (("mean_pct", self._wishes.mean_pct), ("paired_pct", self._wishes.difference_pct))
        limits = {attribute: wish for attribute, wish in wishes if wish is not None}
        needs = {name: self._fewest_people(expected, wish, name) for name, wish in limits.items()}
        most = max((need for need in needs.values() if need is not None), default=participants)
        for name, need in needs.items():
            if need is None or (asked is not None and need > asked):
                # The most that a wish needs are enough for all.
                people = None if need is None else most
                self._refused.append(self._more_people(expected, limits[name], name, people))
        if asked is None and needs:
            participants = most
        numbers = sorted({*_PEOPLE, participants} - {1})
        rows = (people_rows(expected, n, self._wishes.share) for n in numbers)
        return tuple(chain.from_iterable(rows)), participants

    def _more_people(
        self, expected: ExpectedPeople | None, wish: float, attribute: str, need: int | None
    ) -> str:
        """Return why so many people are too few, and the nearest possible wishes."""
        at = self._wishes.participants or MOST_PEOPLE
        of_mean = attribute == "mean_pct"
        option, most = (
            ("--mean", MOST_MEAN_PCT) if of_mean else ("--difference", MOST_DIFFERENCE_PCT)
        )
        remedies = [] if need is None else [f"--participants {need}"]
        if at > 1:
            reach = self._worst(people_rows(expected, at, self._wishes.share), attribute)
            remedies += [f"{option} {rounded_up(reach):g}"] if reach <= most else []
        nearest = ", or ".join(remedies) or "more participants, pulses or sensors"
        people = format_count(at, "participant")
        letters = " and ".join(LETTERS[name] for name in self._wishes.parameters)
        return f"{option} {wish:g} % of {letters} cannot be had with {people}. Nearest: {nearest}."

    def _fewest_people(
        self, expected: ExpectedPeople | None, wish: float, attribute: str
    ) -> int | None:
        for n in range(2, MOST_PEOPLE + 1):
            if self._worst(people_rows(expected, n, self._wishes.share), attribute) <= wish:
                return n
        return None

    def _worst(self, rows: Sequence[PlannedPeople], attribute: str) -> float:
        """Return the largest of the requested quantity; infinite where nothing is decided."""
        values = {r.parameter: float(getattr(r, attribute)) for r in rows}
        return max(values.get(name, np.inf) for name in self._wishes.parameters)

    # --- limit of displacement -----------------------------------------------------------------

    def _aborted(self, design: Design, joint: ExpectedJoint | None) -> float | None:
        """Return the share of pulses that the limit of displacement will abort, and say it."""
        if self._limit_rad is None or joint is None:
            return None
        legs = drawn_parameters(self._lab, design, n=_ABORTING_LEGS, seed=self._seed)
        share = pulse_choice.aborted_share(self._lab, legs, design, self._limit_rad, joint.inertia)
        self._notes.append(
            f"The limit of displacement ({self._limit_rad:g} rad) is expected to abort "
            f"{100.0 * share:.1f} % of the pulses at their first try. jointz run repeats them, and "
            "withdraws a kind of pulse that is aborted three times in a person."
            + " With a smaller --motion fewer are aborted."
            * (share > _MANY_ABORTED)
        )
        return share

    # --- protocol ------------------------------------------------------------------------------

    def _protocol(
        self,
        spec: Protocol,
        design: Design,
        counts: Mapping[str, int],
        estimates: Sequence[PlannedEstimate],
        participants: int,
    ) -> str:
        planned: dict[str, dict[str, float]] = {parameter: {} for parameter in PARAMETERS}
        for e in estimates:
            planned[e.parameter][e.timing_point] = round(e.half_width_pct, 1)
        text = protocol_text(
            spec,
            design,
            counts,
            participants=participants,
            half_width_pct=planned,
            displacement_rad=self._limit_rad,
            sensors=self._sensors,
        )
        if problems := problems_of(text):
            self._refused.append(
                f"The limits of {spec.name} do not allow these pulses: {'; '.join(problems)} "
                "Nearest: a smaller --motion or --torque, or other limits in the protocol."
            )
            return ""
        return text


def _replaced(own: PlannedShape, chosen: PlannedShape) -> str:
    """Say why a protocol's own pulses were replaced."""
    before, after = (
        ", ".join(f"{v:.0f}" for v in (s.stiffness_pct, s.damping_pct, s.inertia_pct))
        for s in (own, chosen)
    )
    why = own.why_not or f"half-widths of K, B, J are {before} % with them and {after} % with these"
    return f"The protocol's own pulses ({own.text}) were replaced: {why}."


def _size(pct: float) -> str:
    return f"{pct:.0f} %" if pct <= _LARGEST_NAMED_PCT else f"over {_LARGEST_NAMED_PCT:.0f} %"


def _float(counts: Mapping[str, int]) -> dict[str, float]:
    return {name: float(n) for name, n in counts.items()}


def _sensor_sets(here: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return the sets of sensors to compare with: one more, one less, all."""
    rest = [n for n in SENSORS if n != "goniometer"]
    sets = [tuple(n for n in SENSORS if n in (*here, extra)) for extra in rest if extra not in here]
    sets += [tuple(n for n in here if n != gone) for gone in rest if gone in here]
    if len([n for n in rest if n not in here]) > 1:
        sets.append(tuple(SENSORS))
    return sets


def _measure(what: str, half_width: np.ndarray) -> PlannedMeasure:
    return PlannedMeasure(what, *(100.0 * np.median(half_width, axis=1)).tolist())


def _sources(
    middle: PlannedLeg, counts: Mapping[str, float], known: Mapping[str, np.ndarray]
) -> dict[str, dict[str, float]]:
    """Return the share of the variance of a typical leg that each source explains, by parameter."""
    half = middle.estimates(counts).half_width
    endless = middle.estimates(dict.fromkeys(counts, ENDLESS)).half_width
    without = {**known, "noise": endless}
    shares: dict[str, dict[str, float]] = {name: {} for name in PARAMETERS}
    for source, left in without.items():
        part = 1.0 - np.median((np.arcsinh(left) / np.arcsinh(half)) ** 2, axis=1)
        for name, value in zip(PARAMETERS, part.tolist(), strict=True):
            shares[name][source] = max(0.0, value)
    return shares
