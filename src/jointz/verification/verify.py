"""Whether a set-up shows a known addition to the joint."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Final

import numpy as np
import pandas as pd
from scipy.special import stdtrit
from scipy.stats import chi2, norm

from jointz.analysis.analyze import analyze
from jointz.analysis.participant_jobs import (
    participant_settings,
    read_participant,
    recommended_method,
)
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.core.errors import DataError
from jointz.core.events import row_label
from jointz.core.study import MOST_ADDED, AdditionSpec, Study
from jointz.identify.estimators import ParticipantData
from jointz.identify.preparation.calibration import gains_sd
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.preparation.sources import RecordingInput, prepare_sources
from jointz.identify.walking.addition import (
    PARTS,
    AdditionFit,
    explained_by,
    fit_addition,
    pair_model,
    stated_addition,
)
from jointz.identify.walking.bayesian_method import BayesianMethod, LegData
from jointz.io.study_reader import open_study
from jointz.report.wording import status_meaning
from jointz.results.base import Axes, PlottedResult
from jointz.results.estimates import FEWEST_PEOPLE, REACH_95, WIDEST, CellEstimate
from jointz.results.figure_style import BLUE, GREEN, INK, ORANGE
from jointz.tasks.engine import on_one_thread

PASS, FAIL, CANNOT_TELL = "pass", "fail", "cannot tell"
_BY_LEG: Final = ("verdicts", "p", "explanations")
_LEVEL: Final = 0.95
_MEAN: Final = "mean of legs"
#: States of an estimate that no load can have.
_WRONG: Final = (Failure.BELOW_ZERO.status, Failure.OUTSIDE_RANGE.status)
#: Error of a bench -> power of its size in each part.
_CAUSES: Final[Mapping[str, Mapping[str, int]]] = {
    "torque over angle": {"stiffness": 1, "damping": 1, "inertia": 1},
    "time between samples": {"stiffness": 0, "damping": 1, "inertia": 2},
}
#: Smallest sd of a part by itself, of its value.
_LEAST_SD: Final = 0.005
#: With less, no error is named.
_LEAST_LOG_ODDS: Final = 2.0
#: No more than so many times the pulses are proposed.
_MOST_TIMES: Final = 20.0


@dataclass(frozen=True, slots=True)
class AdditionResult:
    """One part of an addition to one person, as the pulses show it.

    Parameters
    ----------
    participant : str
        The person's id (and side); on a bench load and timing point.
    part : str
        ``stiffness`` (N*m/rad) or ``inertia`` (kg*m^2); on a bench also ``damping`` (N*m*s/rad).
    stated, stated_sd : float
        The addition as the study states it.
    found, ci_low, ci_high : float, optional
        What the pulses show, with its 95 % interval; None without an estimate.
    verdict : str
        ``pass``, ``fail`` or ``cannot tell``.
    times_pulses : float, optional
        Times as many pulses for an interval of half the addition; None where none would do.
    """

    participant: str
    part: str
    stated: float
    stated_sd: float
    found: float | None
    ci_low: float | None
    ci_high: float | None
    verdict: str
    times_pulses: float | None


@dataclass(frozen=True, slots=True, repr=False)
class Verification(PlottedResult):
    """Whether a set-up shows a known addition to the joint.

    Parameters
    ----------
    parts : tuple of AdditionResult
        Stiffness and inertia of every participant; on a bench what is stated of every load.
    verdicts : mapping of str to str
        Participant (and side), mean of three legs or more, or load and timing point -> ``fail`` if
        a part does or a sensor contradicts the model, else ``cannot tell`` if a part does, else
        ``pass``.
    p : mapping of str to float
        The same -> probability of a difference as large, if the set-up is right (of the part that
        differs most, times the number of parts); None for those that could not be fitted.
    explanations : mapping of str to str
        The same -> the error that explains a failure best, or what could not be estimated.
    """

    SCHEMA: ClassVar[str] = "jointz.Verification/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (6.4, 3.2)

    parts: tuple[AdditionResult, ...]
    verdicts: Mapping[str, str]
    p: Mapping[str, float | None]
    explanations: Mapping[str, str]

    @property
    def verdict(self) -> str:
        """The worst verdict on any leg."""
        return _worst(self.verdicts.values())

    def to_frame(self) -> pd.DataFrame:
        """Return a row for each participant and part."""
        return pd.DataFrame([{k: getattr(r, k) for k in r.__slots__} for r in self.parts])

    def _draw(self, axes: "Axes") -> None:
        """Draw every interval over what was stated, by person."""
        people = list(self.verdicts)
        known = [row for row in self.parts if row.stated and row.found is not None]
        drawn = [part for part in PARAMETERS if any(row.part == part for row in known)]
        for k, (part, color) in enumerate(zip(drawn, (BLUE, ORANGE, GREEN), strict=False)):
            rows = [row for row in known if row.part == part]
            beside = 0.2 * (k - 0.5 * (len(drawn) - 1))
            at = [people.index(row.participant) + beside for row in rows]
            found, low, high = (
                np.array([100.0 * getattr(row, name) / row.stated for row in rows])
                for name in ("found", "ci_low", "ci_high")
            )
            bars = [found - low, high - found]
            sure = [100.0 * REACH_95 * row.stated_sd / row.stated for row in rows]
            axes.errorbar(
                at, np.full_like(found, 100.0), sure, fmt="none", ecolor="0.85", elinewidth=3
            )
            axes.errorbar(at, found, yerr=bars, fmt="o", color=color, ms=4.0, label=part)
        axes.axhline(100.0, color=INK, lw=0.8)
        labels = [f"{person}: {verdict}" for person, verdict in self.verdicts.items()]
        axes.set_xticks(range(len(people)), labels, rotation=90.0 if len(people) > 3 else 0.0)
        axes.set_xlim(-0.6, len(people) - 0.4)
        axes.set_ylabel("Found, % of the addition")
        if drawn:
            axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)

    def summary(self) -> str:
        """Return a few lines of text."""
        lines = []
        for person, verdict in self.verdicts.items():
            p = self.p[person]
            lines.append(f"{person}: {verdict}" + ("" if p is None else f" (p = {p:.2g})"))
            lines += [f"  {_sentence(r)}" for r in self.parts if r.participant == person]
            if why := self.explanations.get(person):
                lines.append(f"  {why}")
        return "\n".join(lines)


def verify(study: Study | str | os.PathLike[str]) -> Verification:
    """Compare a known addition to the joint with what the pulses show of it.

    In walking the recordings of the sessions that ``[[additions]]`` of the study names, and those
    of all others, are explained as one leg with one set of instruments; on a bench the estimates
    of :func:`jointz.analyze` are compared with the loads as stated (docs/verify.md).

    Parameters
    ----------
    study : Study or path
        A study with ``[[additions]]``.

    Returns
    -------
    Verification
        Stiffness and inertia of the addition, or what is stated of loads, with 95 % intervals,
        and verdicts.

    Raises
    ------
    DataError
        When the study states no addition, nothing could be estimated, or in walking additions
        differ, or pulses without or with it are missing.
    """
    opened = study if isinstance(study, Study) else open_study(study)
    if not opened.spec.additions:
        raise DataError(
            f"{opened.root}: expected [[additions]]: what was added in which session, or the loads."
        )
    if opened.spec.kind == "bench":
        cells = analyze(opened, progress=False).cells
        found = [v for load in opened.spec.additions for v in _verified_load(opened, load, cells)]
    else:
        addition = _addition(opened)
        legs = [(p.id, side) for p in opened.spec.participants for side in _sides(opened, p.id)]
        found = [on_one_thread(partial(_verified, opened, addition, *leg)) for leg in legs]
        found += _together(found, addition)
    if not any(one.parts for one in found):
        why = (f"{leg}: {why}" for one in found for leg, why in one.explanations.items())
        raise DataError("; ".join(why))
    return Verification(
        tuple(row for one in found for row in one.parts),
        *({k: v for one in found for k, v in getattr(one, name).items()} for name in _BY_LEG),
    )


def _sides(study: Study, person: str) -> list[str]:
    """Return the sides of a person's pulses; "" where they are not stated."""
    perturbed = (r for r in study.spec.recordings if r.condition == "perturbed")
    return list(dict.fromkeys(r.side or "" for r in perturbed if r.participant == person))


def _verified(study: Study, addition: AdditionSpec, person: str, side: str) -> Verification:
    """Return the verdict on one leg, also on one that cannot be fitted."""
    spec, leg = study.spec.participant(person), row_label(person, "", side)
    try:
        pair = _pair(study, person, side)
        model = pair_model(*pair, addition, spec)
        fit = fit_addition(model, pair[0].priors)
    except (DataError, np.linalg.LinAlgError) as exc:
        return _of_leg(leg, (), CANNOT_TELL, None, [str(exc)])
    p, parts = _judged(leg, fit, addition, tuple(PARTS))
    verdict = _worst(part.verdict for part in parts)
    against = "; ".join(map(str, fit.unlikely))
    texts = [f"sensors contradict the model: {against}"] if against else []
    if verdict == FAIL:
        texts.append(_explanation(explained_by(model, pair[0].priors, addition)))
    verdict = FAIL if fit.unlikely else verdict
    return _of_leg(leg, parts, verdict, p, texts)


def _of_leg(
    leg: str, parts: Sequence[AdditionResult], verdict: str, p: float | None, texts: Sequence[str]
) -> Verification:
    explained = {leg: "; ".join(texts)} if texts else {}
    return Verification(tuple(parts), {leg: verdict}, {leg: p}, explained)


def _together(found: Sequence[Verification], addition: AdditionSpec) -> list[Verification]:
    """Return the verdict on the mean stiffness over legs, which have the errors of one set-up.

    The felt share of an inertia is not known well enough for a mean.
    """
    values = np.array([one.parts[0].found for one in found if one.parts], dtype=float)
    n = len(values)
    if n < FEWEST_PEOPLE or addition.stiffness is None:
        return []
    reach = stdtrit(n - 1, 0.975) * values.std(ddof=1) / np.sqrt(n)
    sd = np.array([reach / REACH_95])
    fit = AdditionFit(np.array([values.mean()]), sd, sd / np.sqrt(2.0), ())
    p, parts = _judged(_MEAN, fit, addition, ["stiffness"])
    return [_of_leg(_MEAN, parts, parts[0].verdict, p, ())]


def _verified_load(
    study: Study, load: AdditionSpec, cells: Iterable[CellEstimate]
) -> list[Verification]:
    """Return the verdicts on a load of a bench, one a timing point at which it was measured."""
    own = [cell for cell in cells if cell.participant == load.participant]
    measured = [cell for cell in own if cell.n_used + cell.n_excluded] or own
    entry = next(r for r in study.spec.recordings if r.participant == load.participant)
    gain_sd = gains_sd(study.spec.calibration_of(entry))
    return [_verified_cell(cell, load, gain_sd) for cell in measured]


def _verified_cell(cell: CellEstimate, load: AdditionSpec, gain_sd: float) -> Verification:
    """Return the verdict on a load of a bench at a timing point."""
    case = row_label(cell.participant, cell.timing_point)
    stated = [p for p in cell.parameters if getattr(load, p.name, None) is not None]
    told = [p for p in stated if p.status == "ok"]
    least, rows, texts = None, list[AdditionResult](), list[str]()
    if told:
        values = np.array([p.value for p in told], dtype=float)
        ends = np.array([p.ci for p in told], dtype=float)
        sds = np.abs(ends - values[:, None]).max(axis=1) / REACH_95
        fit = AdditionFit(values, sds, sds, ())
        least, rows = _judged(case, fit, load, [p.name for p in told])
        if any(row.verdict == FAIL for row in rows):
            texts.append(_cause(rows, gain_sd))
    for p in stated:
        if p not in told:
            known, verdict = getattr(load, p.name), FAIL if p.status in _WRONG else CANNOT_TELL
            without = (known.value, known.sd, None, None, None, verdict, None)
            rows.append(AdditionResult(case, p.name, *without))
            texts.append(f"{p.name}: {status_meaning(p.status)}")
    return _of_leg(case, rows, _worst(row.verdict for row in rows), least, texts)


def _cause(parts: Sequence[AdditionResult], gain_sd: float) -> str:
    """Name the error of one size that explains how all parts of a load differ."""
    stated, stated_sd, found, high = np.array(
        [(row.stated, row.stated_sd, row.found, row.ci_high) for row in parts], dtype=float
    ).T
    own = ((high - found) / REACH_95 / found) ** 2 - gain_sd**2  # the gain is common to all
    sds = np.sqrt(np.maximum(own, _LEAST_SD**2) + (stated_sd / stated) ** 2)
    off = np.log(found / stated) / sds
    left = []
    for name, powers in _CAUSES.items():
        effect = np.array([powers[row.part] for row in parts]) / sds
        size = float(effect @ off / max(effect @ effect, _LEAST_SD))
        left.append((float(np.sum((off - size * effect) ** 2)), float(np.exp(size)), name))
    rest, times, name = min(left)
    if len(parts) < 2 or rest > chi2.ppf(_LEVEL, len(parts) - 1):
        return "no single error of the set-up explains it: check the load as stated"
    return f"{name} {times:.2f} times as large as right would explain it"


def _addition(study: Study) -> AdditionSpec:
    """Return the addition of all loaded sessions."""
    additions = study.spec.additions
    first = additions[0]
    if any(one.model_copy(update={"session": first.session}) != first for one in additions):
        raise DataError(f"{study.root}: additions: expected the same in all sessions.")
    stated, _ = stated_addition(first)
    if any(value > MOST_ADDED[part] for part, value in zip(PARTS, stated, strict=True)):
        most = " and ".join(f"{MOST_ADDED[part]:g} {unit}" for part, unit in PARTS.items())
        raise DataError(
            f"{study.root}: additions: expected at most {most}, more than any knee has. Check the "
            "units."
        )
    return first


def _worst(verdicts: Iterable[str]) -> str:
    return max(verdicts, key=(PASS, CANNOT_TELL, FAIL).index)


def _pair(study: Study, person: str, side: str) -> tuple[LegData, LegData]:
    """Return the pulses of a leg without and with the addition."""
    loaded = {one.session for one in study.spec.additions}
    settings = participant_settings(study, person, recommended_method(study), resamples=2, seed=0)
    entries = {entry.label: entry for entry in study.spec.recordings}
    groups: tuple[list[RecordingInput], list[RecordingInput]] = ([], [])
    for recording in read_participant(study, person, {}):
        entry = entries[recording.file]
        if (entry.side or side) == side:
            groups[entry.session in loaded].append(recording)
    if not all(any(r.condition == "perturbed" for r in group) for group in groups):
        raise DataError("expected pulses without and with the addition.")
    method = BayesianMethod()
    without, with_addition = (
        method.leg_data(ParticipantData(person, prepare_sources(group, settings)), settings)
        for group in groups
    )
    return without, with_addition


def _judged(
    leg: str, fit: AdditionFit, addition: AdditionSpec, names: Sequence[str]
) -> tuple[float, list[AdditionResult]]:
    """Return the p-value of the part that differs most, for all parts, and the parts."""
    stated, stated_sd = stated_addition(addition, names)
    errors, more = np.hypot(fit.sd, stated_sd), np.hypot(fit.more_pulses, stated_sd)
    # NaN where neither has an error and they are the same: cannot be told.
    p = np.minimum(len(names) * 2.0 * norm.sf(np.abs(fit.mean - stated) / errors), 1.0)
    rows = []
    for k, part in enumerate(names):
        reach, wide = REACH_95 * fit.sd[k], REACH_95 * errors[k] > WIDEST * stated[k] > 0.0
        rows.append(
            AdditionResult(
                leg,
                part,
                float(stated[k]),
                float(stated_sd[k]),
                float(fit.mean[k]),
                float(fit.mean[k] - reach),
                float(fit.mean[k] + reach),
                FAIL if p[k] < 1.0 - _LEVEL else PASS if p[k] <= 1.0 and not wide else CANNOT_TELL,
                _times_pulses(float(errors[k]), float(more[k]), float(stated[k])),
            )
        )
    return float(p.min()), rows


def _times_pulses(sd: float, with_twice: float, stated: float) -> float | None:
    """Return how many times the pulses make the interval half of the addition."""
    wanted = WIDEST * stated / REACH_95
    by_pulses = 2.0 * (sd**2 - with_twice**2)  # falls with their number, the rest stays
    least = sd**2 - by_pulses
    if not stated or wanted**2 <= least:
        return None
    times = by_pulses / (wanted**2 - least)
    return max(times, 1.0) if times <= _MOST_TIMES else None


def _explanation(evidence: Mapping[str, float]) -> str:
    """Name the error that makes the addition as stated likeliest."""
    best = max(evidence, key=lambda error: evidence[error])
    odds = evidence[best] - evidence[""]
    if odds < _LEAST_LOG_ODDS:
        return "no single error explains it: check the addition as stated, and that it was on"
    return f"best explained by the {best} (log odds {odds:.1f} over no error)"


def _sentence(row: AdditionResult) -> str:
    unit = PARAMETER_UNITS[row.part]
    if row.found is None:
        return f"{row.part}: no estimate, stated {row.stated:.3g} {unit}: {row.verdict}"
    text = (
        f"{row.part}: {row.found:.3g} [{row.ci_low:.3g}, {row.ci_high:.3g}] {unit}, stated "
        f"{row.stated:.3g}: {row.verdict}"
    )
    if row.verdict != CANNOT_TELL:
        return text
    more = row.times_pulses
    if REACH_95 * row.stated_sd > WIDEST * row.stated > 0.0:
        return f"{text} (its SD as stated is too wide)"
    if more is None:
        return f"{text} (more pulses would not narrow the interval enough)"
    return f"{text} (about {more:.1f} times as many pulses are needed)"
