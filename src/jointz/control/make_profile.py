"""A profile from results, or from published figures: what a controller follows over the cycle."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Any

import numpy as np
from scipy.stats import t as students_t

from jointz.control.impedance_profile import GRID_PCT, ImpedanceProfile, ProfileKnot, mean_velocity
from jointz.control.knots import METHOD, Curve, Impedance, measured_impedance, published_impedance
from jointz.core.errors import DataError
from jointz.core.events import row_label
from jointz.core.grouping import by_key
from jointz.core.provenance import now, software
from jointz.io.protocols import PUBLISHED
from jointz.reference import chapter4
from jointz.reference import published_knee as published
from jointz.results.estimates import REACH_95
from jointz.results.mean_stride import MeanStride
from jointz.results.series.cycle_curve import MEAN
from jointz.results.study_analysis import StudyAnalysis

_LEVEL = 0.95
#: Draws behind the interval of the equilibrium; their seed is fixed, so that a file is repeatable.
_DRAWS, _SEED = 4000, 1
#: Masses of bodies.
_LIGHTEST_KG, _HEAVIEST_KG = 1.0, 500.0
#: Conditions in the order in which their mean stride is taken.
_CONDITIONS = ("unperturbed", "no_device", "perturbed")


@dataclass(frozen=True, slots=True, eq=False)
class _Gait:
    """Mean stride that the equilibrium is computed along, with sds of its errors."""

    angle: np.ndarray  # (100,) rad
    angle_sd: np.ndarray  # between strides
    angle_error: np.ndarray  # sd of the error of the mean
    moment: np.ndarray  # (100,) N*m
    moment_sd: np.ndarray
    moment_error: np.ndarray
    stride_s: float
    sources: Mapping[str, str]
    warnings: tuple[str, ...] = ()


def impedance_profile(
    analysis: StudyAnalysis | None = None,
    participant: str | None = None,
    *,
    mass_kg: float | None = None,
) -> ImpedanceProfile:
    """Return stiffness, damping and equilibrium angle over the gait cycle for a controller.

    Parameters
    ----------
    analysis : StudyAnalysis, optional
        Analysis of a walking study; the published profile of the knee without it.
    participant : str, optional
        A participant, with session and side if the study has them: ``S01, left``; by default
        the mean over all participants.
    mass_kg : float, optional, kg
        Body mass for a mean over people or the published profile; by default their mean.

    Returns
    -------
    ImpedanceProfile
        The profile, with pointwise 95 % intervals.

    Raises
    ------
    DataError
        When the study is no walking study, masses or the participant are unknown, or no mean stride
        stands in the results.
    EstimationError
        When an interval of stiffness or damping at a timing point reaches zero (the message says
        which pulses would help), fewer than four timing points have estimates, or the data speak
        against the model.

    Notes
    -----
    The equilibrium angle is angle + (moment + damping * velocity) / stiffness along the mean
    stride without pulses (Hogan 1985, doi 10.1115/1.3140702). The moment is the internal one of
    inverse dynamics (channel ``joint_moment``); where none was recorded, a published one of the
    knee, which is named. Stiffness and damping are those for small displacements where the method
    estimates them, secants over the window otherwise. Between timing points they follow a
    periodic Gaussian process of the logarithms, whose interval widens away from the points. The
    interval of the equilibrium holds errors of stiffness and damping (with their correlation),
    of mean angle and moment, and of lag and gain of the angle; it does not hold errors of the
    inverse dynamics that all strides share.
    """
    if mass_kg is not None and not _LIGHTEST_KG <= mass_kg <= _HEAVIEST_KG:
        raise DataError(
            f"mass_kg: expected {_LIGHTEST_KG:g} to {_HEAVIEST_KG:g} kg, got {mass_kg:g} kg."
        )
    if analysis is None:
        impedance, gait = published_impedance(), _published_gait()
        about: dict[str, Any] = {"subject": PUBLISHED, "joint": "knee", "positive": "flexion"}
        made = _made(impedance, gait, about | {"scales_with_mass": True}, 1.0)
        return made.for_mass(mass_kg or chapter4.MASS.value)
    _check_study(analysis)
    label = None if participant is None else _label(analysis, participant)
    masses, strides = _masses(analysis), _strides(analysis, label)
    impedance = measured_impedance(analysis, label)
    if label is not None and mass_kg is not None:
        raise DataError(f"profile of {label}: mass_kg is for a mean over people. Leave it out.")
    people = {cell.participant for cell in analysis.cells if label in (None, cell.label)}
    own_kg = fmean(masses[person] for person in people)
    gait = _measured_gait(analysis, strides, masses, own_kg, label)
    about = {
        "subject": label or MEAN,
        "scales_with_mass": label is None,
        "joint": analysis.settings["joint"],
        "positive": analysis.settings["positive"],
        "side": strides[0].side if label is not None else "",
        "provenance": {"created": now(), "study_sha256": analysis.provenance.get("study_sha256")},
    }
    made = _made(impedance, gait, about, own_kg)
    return made if mass_kg is None else made.for_mass(mass_kg)


def _check_study(analysis: StudyAnalysis) -> None:
    if analysis.settings.get("kind") != "walking" or not analysis.mean_strides:
        raise DataError(
            "profile: expected results of a walking study with mean strides. Analyse the study "
            "again with this version: jointz analyze."
        )


def _label(analysis: StudyAnalysis, participant: str) -> str:
    labels = list(dict.fromkeys(cell.label for cell in analysis.cells))
    own = {cell.label for cell in analysis.cells if cell.participant == participant}
    label = own.pop() if len(own) == 1 else participant
    if label not in labels:
        raise DataError(
            f"profile: expected one of the participants {'; '.join(labels)}, got {participant!r}."
        )
    return label


def _masses(analysis: StudyAnalysis) -> dict[str, float]:
    """Return participant -> body mass, kg."""
    people = analysis.provenance.get("study", {}).get("participants", ())
    masses = {str(p["id"]): p.get("mass_kg") for p in people}
    of = {cell.participant for cell in analysis.cells}
    of |= {stride.participant for stride in analysis.mean_strides}
    missing = [person for person in of if not masses.get(person)]
    if missing:
        raise DataError(
            f"profile: no mass of {', '.join(sorted(missing))}. A controller must know whom it "
            "fits: give mass_kg in study.toml and analyse again."
        )
    return {name: float(mass) for name, mass in masses.items() if mass}


def _strides(analysis: StudyAnalysis, label: str | None) -> list[MeanStride]:
    """Return a mean stride of each session and side: with a moment where there is one."""
    labelled = [(row_label(s.participant, s.session, s.side), s) for s in analysis.mean_strides]
    wanted = ((own, s) for own, s in labelled if label in (None, own) and s.stride_s is not None)
    units = by_key(wanted)
    if not units:
        labels = {own for own, _ in labelled}
        raise DataError(
            f"profile of {label or MEAN}: no mean stride in the results, which have those of "
            f"{'; '.join(sorted(labels))}. Give recordings without pulses of this session and "
            "side, or, if the results are of an earlier version, analyse the study again."
        )

    def order(stride: MeanStride) -> tuple[bool, int]:
        return stride.moment is None, _CONDITIONS.index(stride.condition)

    return [min(own, key=order) for own in units.values()]


def _measured_gait(
    analysis: StudyAnalysis,
    strides: Sequence[MeanStride],
    masses: Mapping[str, float],
    mass_kg: float,
    label: str | None,
) -> _Gait:
    """Return the mean stride of one participant, or of people for a body of the mean mass."""
    people: dict[str, list[_Gait]] = {}
    with_moment = [stride for stride in strides if stride.moment is not None]
    for stride in with_moment or strides:
        gait = _for_mass(_one_gait(analysis, stride), mass_kg / masses[stride.participant])
        people.setdefault(stride.participant, []).append(gait)
    one = [_average(gaits) for gaits in people.values()]  # sessions and sides first
    gait = one[0] if label is not None else _over_people(one)
    if not with_moment:
        return _with_moment_of_others(analysis, gait, mass_kg)
    n, all_people = len(one), len({stride.participant for stride in strides})
    if n < all_people:
        text = f"the mean stride is that of the {n} of {all_people} people with a moment"
        gait = replace(gait, warnings=(*gait.warnings, text))
    return gait


def _for_mass(gait: _Gait, ratio: float) -> _Gait:
    moments = {n: ratio * getattr(gait, n) for n in ("moment", "moment_sd", "moment_error")}
    return replace(gait, **moments)


def _average(gaits: Sequence[_Gait]) -> _Gait:
    """Return the mean of gaits; their errors are taken as common to them."""
    arrays = {
        name: np.mean([getattr(gait, name) for gait in gaits], axis=0)
        for name in ("angle", "angle_sd", "angle_error", "moment", "moment_sd", "moment_error")
    }
    warnings = dict.fromkeys(text for gait in gaits for text in gait.warnings)
    stride_s = fmean(gait.stride_s for gait in gaits)
    return replace(gaits[0], **arrays, stride_s=stride_s, warnings=tuple(warnings))


def _over_people(one: Sequence[_Gait]) -> _Gait:
    """Return the mean over people; SD and errors are those between people."""
    mean, n = _average(one), len(one)
    text = f"; mean over {n} people"
    sources = {name: source + text for name, source in mean.sources.items()}
    if n == 1:
        return replace(mean, sources=sources)
    angle_sd, moment_sd = (_sd([getattr(g, name) for g in one]) for name in ("angle", "moment"))
    # Of few people: as much wider as Student's interval is than the normal one.
    share = float(students_t.ppf(0.5 + _LEVEL / 2.0, n - 1)) / REACH_95 / np.sqrt(n)
    return replace(
        mean,
        angle_sd=angle_sd,
        angle_error=np.hypot(share * angle_sd, mean.angle_error),
        moment_sd=moment_sd,
        moment_error=share * moment_sd,
        sources=sources,
    )


def _sd(curves: Sequence[np.ndarray]) -> np.ndarray:
    return np.asarray(np.std(curves, axis=0, ddof=1))


def _one_gait(analysis: StudyAnalysis, stride: MeanStride) -> _Gait:
    """Return the mean stride of a participant at the joint: lag and gain of the angle taken out."""
    stride_s, warnings = float(stride.stride_s or 0.0), []
    calibration = _calibration(analysis, stride.participant)
    gain = calibration.get("angle_gain") or {"value": 1.0, "sd": 0.0}
    lag_s, lag_sd_s, known = _lag(analysis, stride, calibration)
    if not known:
        warnings.append(
            "the lag of the angle is not known: it moves the equilibrium angle by lag * velocity. "
            "Measure it and state [calibration] angle_lag_s"
        )
    shown = _periodic(stride.angle) / gain["value"]
    angle = _later(shown, lag_s / stride_s)
    velocity = mean_velocity(angle, stride_s)
    n, sd = stride.n_strides, _periodic(stride.angle_sd)
    error = np.sqrt(sd**2 / n + (lag_sd_s * velocity) ** 2 + (gain["sd"] * angle) ** 2)
    none = np.zeros(GRID_PCT.size)
    moment = none if stride.moment is None else _periodic(stride.moment)
    moment_sd = none if stride.moment_sd is None else _periodic(stride.moment_sd)
    where = f"mean of {n} strides, condition {stride.condition}"
    return _Gait(
        angle,
        sd,
        error,
        moment,
        moment_sd,
        moment_sd / np.sqrt(n),
        stride_s,
        {"angle": where, "moment": f"channel joint_moment, {where}"},
        tuple(warnings),
    )


def _calibration(analysis: StudyAnalysis, participant: str) -> dict[str, Any]:
    """Return the calibration of a participant's instruments over that of the study."""
    study = analysis.provenance.get("study", {})
    people = {person["id"]: person for person in study.get("participants", ())}
    own = people.get(participant, {}).get("calibration", {})
    return {**study.get("calibration", {}), **own}


def _lag(
    analysis: StudyAnalysis, stride: MeanStride, calibration: Mapping[str, Any]
) -> tuple[float, float, bool]:
    """Return the lag of the angle with its sd, s, and whether anything is known of it."""
    label = row_label(stride.participant, stride.session, stride.side)
    nuisances = (p for c in analysis.cells if c.label == label for p in c.nuisance)
    lag = next((p for p in nuisances if p.name == "angle_lag"), None)
    if lag is not None and lag.value is not None and lag.ci_high is not None:
        return lag.value, (lag.ci_high - lag.value) / REACH_95, True
    measured = calibration.get("angle_lag_s")
    return (0.0, 0.0, False) if measured is None else (measured["value"], measured["sd"], True)


def _periodic(nodes: np.ndarray) -> np.ndarray:
    """Return a curve of 0 to 100 % at the phases of a profile; both ends are one phase."""
    curve = np.asarray(nodes, dtype=float)[:-1].copy()
    curve[0] = 0.5 * (nodes[0] + nodes[-1])
    return curve


def _later(curve: np.ndarray, cycles: float) -> np.ndarray:
    """Return a periodic curve as it is a part of the cycle later."""
    return np.asarray(np.interp(GRID_PCT + 100.0 * cycles, GRID_PCT, curve, period=100.0))


def _published_gait() -> _Gait:
    """Return the published stride of the knee, for 1 kg."""
    sd = np.full(GRID_PCT.size, published.ANGLE_SD_RAD)
    sources = {"angle": published.SOURCE.format(sd=f"{published.ANGLE_SD_RAD} rad")}
    angle, no_moment = published.published_angle(GRID_PCT), np.zeros(GRID_PCT.size)
    moments = no_moment, no_moment, no_moment
    return _with_published_moment(_Gait(angle, sd, sd, *moments, published.STRIDE_S, sources), 1.0)


def _with_moment_of_others(analysis: StudyAnalysis, gait: _Gait, mass_kg: float) -> _Gait:
    joint, positive = analysis.settings["joint"], analysis.settings["positive"]
    if (joint, positive) != ("knee", "flexion"):
        raise DataError(
            f"profile: no internal moment of the {joint} was recorded, and the published one is of "
            "a knee with flexion positive. Give the moment of inverse dynamics as a channel "
            "joint_moment and analyse again."
        )
    gait = _with_published_moment(gait, mass_kg)
    text = (
        "no internal moment was recorded: a published one of other people was taken, and the "
        "equilibrium angle is theirs as much as this person's"
    )
    return replace(gait, warnings=(*gait.warnings, text))


def _with_published_moment(gait: _Gait, mass_kg: float) -> _Gait:
    sd = np.full(GRID_PCT.size, mass_kg * published.MOMENT_SD_NM_KG)
    moment = mass_kg * published.published_moment(GRID_PCT)
    source = published.SOURCE.format(sd=f"{published.MOMENT_SD_NM_KG} N*m/kg")
    return replace(
        gait,
        moment=moment,
        moment_sd=sd,
        moment_error=sd,
        sources={**gait.sources, "moment": source},
    )


def _made(
    impedance: Impedance, gait: _Gait, about: Mapping[str, Any], mass_kg: float
) -> ImpedanceProfile:
    low, value, high = _equilibrium(impedance, gait)
    stiffness, damping = impedance.stiffness, impedance.damping
    work_j, work_sd_j = _work(gait)
    velocity = mean_velocity(gait.angle, gait.stride_s)
    step_s = gait.stride_s / GRID_PCT.size
    return ImpedanceProfile(
        mass_kg=mass_kg,
        stride_s=gait.stride_s,
        gait_pct=GRID_PCT,
        angle=gait.angle,
        angle_sd=gait.angle_sd,
        moment=gait.moment,
        moment_sd=gait.moment_sd,
        stiffness=stiffness.value,
        stiffness_low=stiffness.low,
        stiffness_high=stiffness.high,
        damping=damping.value,
        damping_low=damping.low,
        damping_high=damping.high,
        equilibrium=value,
        equilibrium_low=low,
        equilibrium_high=high,
        knots=_knots(impedance),
        covariance=impedance.covariance,
        displacement=impedance.displacement,
        sources={"impedance": impedance.source, **gait.sources},
        energy_j=work_j,
        energy_low_j=work_j - REACH_95 * work_sd_j,
        energy_high_j=work_j + REACH_95 * work_sd_j,
        damping_loss_j=float(np.sum(damping.value * velocity**2) * step_s),
        ci_level=_LEVEL,
        ci_method=f"{METHOD}; equilibrium by {_DRAWS} draws of all errors",
        warnings=(*impedance.warnings, *gait.warnings),
        **{**about, "provenance": {**software(), "seed": _SEED, **about.get("provenance", {})}},
    )


def _equilibrium(impedance: Impedance, gait: _Gait) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return low end, value and high end of the equilibrium angle."""
    velocity = mean_velocity(gait.angle, gait.stride_s)
    draws = np.random.default_rng(_SEED).standard_normal((4, _DRAWS, 1))
    correlation = _correlation(impedance)
    normals = draws[0], correlation * draws[0] + np.sqrt(1.0 - correlation**2) * draws[1]
    stiffnesses, dampings = (
        curve.value * np.exp(normal * _log_sds(curve))
        for curve, normal in zip((impedance.stiffness, impedance.damping), normals, strict=True)
    )
    angle = gait.angle + gait.angle_error * draws[2]
    moment = gait.moment + gait.moment_error * draws[3]
    drawn = angle + (moment + dampings * velocity) / stiffnesses
    tails = np.quantile(drawn, (0.5 - _LEVEL / 2.0, 0.5 + _LEVEL / 2.0), axis=0)
    stiffness, damping = impedance.stiffness.value, impedance.damping.value
    return tails[0], gait.angle + (gait.moment + damping * velocity) / stiffness, tails[1]


def _correlation(impedance: Impedance) -> np.ndarray:
    """Return the correlation of the logarithms of K and B at the phases of a profile."""
    n, points = len(impedance.stiffness.points), impedance.stiffness.points
    if len(impedance.damping.points) != n:
        return np.zeros(GRID_PCT.size)
    sds = np.sqrt(np.diag(impedance.covariance))
    own = np.diag(impedance.covariance[:n, n:]) / (sds[:n] * sds[n:])
    return np.asarray(np.interp(GRID_PCT, [p.gait_pct for p in points], own, period=100.0))


def _log_sds(curve: Curve) -> np.ndarray:
    return np.asarray(np.log(curve.high / curve.low) / (2.0 * REACH_95))


def _work(gait: _Gait) -> tuple[float, float]:
    """Return the work of the moment over a stride with its sd, J.

    Errors of the moment are alike at neighbouring phases: their sds are added, not their squares.
    """
    turned = 0.5 * (np.roll(gait.angle, -1) - np.roll(gait.angle, 1))
    return float(gait.moment @ turned), float(gait.moment_error @ np.abs(turned))


def _knots(impedance: Impedance) -> tuple[ProfileKnot, ...]:
    damping = {point.timing_point: point for point in impedance.damping.points}
    return tuple(
        ProfileKnot(
            timing_point=one.timing_point,
            stiffness_pct=one.gait_pct,
            damping_pct=other.gait_pct,
            stiffness=one.value,
            stiffness_low=one.interval[0],
            stiffness_high=one.interval[1],
            damping=other.value,
            damping_low=other.interval[0],
            damping_high=other.interval[1],
        )
        for one in impedance.stiffness.points
        if (other := damping.get(one.timing_point)) is not None
    )
