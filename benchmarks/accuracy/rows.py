"""The rows of the benchmark: who walks in what, what is known, and what is asked for."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import radians
from typing import Any, Literal

from jointz.rig.sim.presets import ActuatorSettings, Preset, ReflexSettings, preset

PARAMETERS = ("stiffness", "damping", "inertia")


@dataclass(frozen=True, slots=True)
class Target:
    """What is asked of the method bayesian in a row.

    Parameters
    ----------
    rmse_pct : tuple of float or None
        Largest RMSE of K, B and J in % of truth, decided cells only.
    ratio : float or None
        Largest RMSE over the bound.
    inertia_pct : float or None
        Largest RMSE of J, beside a ratio.
    least_coverage : float or None
        Coverage is met from here on; without it, inside the band around 0.95.
    may_decline : bool
        Whether a row without a decided cell meets it.
    most_undecided : float or None
        Largest share of undecided cells.
    """

    rmse_pct: tuple[float, float, float] | None = None
    ratio: float | None = None
    inertia_pct: float | None = None
    least_coverage: float | None = None
    may_decline: bool = False
    most_undecided: float | None = None


@dataclass(frozen=True, slots=True)
class Row:
    """One row: a rig and what the study knows of it.

    Parameters
    ----------
    name, title : str
        As asked for on the command line; as printed.
    preset : Preset
        The rig.
    lag_sd_s : float or None
        How well the angle's lag is known; None: not at all.
    per_point : int
        Pulses at a timing point.
    stiffness : mapping of str to float
        True K of timing points, N*m/rad, where it is not the person's own.
    inertia_spread : float
        Spread of J over the timing points that the bound assumes known, share; 0: one J.
    from_priors : bool
        K, B and J are drawn each on its own from :data:`benchmarks.accuracy.people.PRIORS`.
    target : Target or None
        What is asked for.
    """

    name: str
    title: str
    preset: Preset
    lag_sd_s: float | None = None
    per_point: int = 50
    stiffness: Mapping[str, float] = field(default_factory=dict)
    inertia_spread: float = 0.0
    from_priors: bool = False
    target: Target | None = None


_NOMINAL, _HARD, _BODY = preset("nominal"), preset("hard"), preset("anthropometric")
_HALF_MS = 0.0005
_FIFTH = 0.2
#: RMS of a cosine of amplitude 1.
_RMS = 0.5**0.5


def _joint(**changes: Any) -> Preset:
    return replace(_NOMINAL, joint=replace(_NOMINAL.joint, **changes))


def _reflex_row(kind: Literal["velocity", "position"], latency_s: float) -> Row:
    milliseconds = round(1000 * latency_s)
    return Row(
        f"reflex-{kind}-{milliseconds}ms",
        f"reflex of 30 % of K, {kind}, {milliseconds} ms, lag known to 0.5 ms",
        _joint(reflex=ReflexSettings(gain=0.3, latency_s=latency_s, kind=kind)),
        _HALF_MS,
        target=Target((12.0, 8.0, 8.0), least_coverage=0.9, may_decline=True),
    )


def _true_stiffness(value: float) -> Row:
    return Row(
        f"stiffness-{value:g}",
        f"true K of {value:g} N*m/rad at ISW and MSW, lag known to 0.5 ms",
        _NOMINAL,
        _HALF_MS,
        stiffness={"ISW": value, "MSW": value},
        target=Target(),
    )


def _few_pulses(count: int, name: str) -> Row:
    title = f"nominal, lag known to 0.5 ms, {count} pulse{'s' * (count > 1)} a point"
    return Row(name, title, _NOMINAL, _HALF_MS, per_point=count, target=Target())


def _actuator(**changes: Any) -> Preset:
    settings: ActuatorSettings = replace(_NOMINAL.actuator, **changes)
    return replace(_NOMINAL, actuator=settings)


def _goniometer(**changes: Any) -> Preset:
    return replace(_NOMINAL, goniometer=replace(_NOMINAL.goniometer, **changes))


def _asked_rows() -> list[Row]:
    """Return the rows of the walking presets with figures to meet."""
    return [
        Row(
            "nominal-lag-unknown",
            "nominal, lag unknown",
            _NOMINAL,
            target=Target((9.0, 5.5, 9.0)),
        ),
        Row(
            "nominal-lag-2.5ms",
            "nominal, lag known to 2.5 ms",
            _NOMINAL,
            0.0025,
            target=Target((8.5, 5.0, 8.0), most_undecided=_FIFTH),
        ),
        Row(
            "nominal-lag-0.5ms",
            "nominal, lag known to 0.5 ms",
            _NOMINAL,
            _HALF_MS,
            target=Target((8.0, 4.5, 6.0), most_undecided=_FIFTH),
        ),
        Row(
            "nominal-10-pulses",
            "nominal, lag known to 0.5 ms, 10 pulses a point",
            _NOMINAL,
            _HALF_MS,
            per_point=10,
            target=Target((12.0, 7.5, 8.0), most_undecided=_FIFTH),
        ),
        Row(
            "nominal-varying-inertia",
            "nominal, lag known to 0.5 ms, J varying 30 % over the cycle",
            _joint(inertia_variation=0.3),
            _HALF_MS,
            inertia_spread=0.3 * _RMS,
            target=Target((13.0, 8.0, 8.0), most_undecided=_FIFTH),
        ),
        Row(
            "hard-lag-0.5ms",
            "hard, lag known to 0.5 ms",
            _HARD,
            _HALF_MS,
            inertia_spread=0.15 * _RMS,
            target=Target((14.0, 9.0, 9.0)),
        ),
        Row(
            "hard-lag-unknown",
            "hard, lag unknown",
            _HARD,
            inertia_spread=0.15 * _RMS,
            target=Target((22.0, 15.0, 20.0)),
        ),
        Row(
            "nominal-smooth",
            "nominal, lag known to 0.5 ms, smooth K and B over phase",
            _joint(smooth=True),
            _HALF_MS,
            target=Target((14.0, 8.0, 7.0), most_undecided=_FIFTH),
        ),
        Row(
            "tissue",
            "nominal behind tissue that resonates at 20-40 Hz, lag unknown",
            _goniometer(tissue_range_hz=(20.0, 40.0)),
            target=Target(ratio=1.5, may_decline=True),
        ),
    ]


def all_rows() -> dict[str, Row]:
    """Return every row by its name, in the order of the page."""
    rows = [
        *_asked_rows(),
        *[_reflex_row("velocity", s) for s in (0.03, 0.06)],
        *[_reflex_row("position", s) for s in (0.03, 0.06)],
        Row(
            "anthropometric",
            "anthropometric, lag unknown",
            _BODY,
            inertia_spread=0.35,
            target=Target(ratio=1.3, inertia_pct=10.0, may_decline=True),
        ),
        Row(
            "friction-30pct",
            "nominal, lag known to 0.5 ms, friction model 30 % off (sd)",
            _actuator(friction_error_sd=0.3),
            _HALF_MS,
            target=Target(),
        ),
        Row(
            "angle-gain-3pct",
            "nominal, lag known to 0.5 ms, angle gain 3 % too large, known to 3 %",
            _goniometer(gain_error=0.03, gain_error_sd=0.03),
            _HALF_MS,
            target=Target(),
        ),
        Row(
            "torsion",
            "nominal, lag known to 0.5 ms, torsion 0.5 deg at 17 N*m",
            _goniometer(torsion_rad_nm=radians(0.5) / 17.0),
            _HALF_MS,
            target=Target(),
        ),
        _true_stiffness(2.0),
        _true_stiffness(0.0),
        _few_pulses(1, "one-pulse"),
        _few_pulses(3, "three-pulses"),
        Row(
            "inside",
            "nominal, lag unknown, K, B and J drawn each on its own, widely spread",
            _NOMINAL,
            from_priors=True,
            target=Target(),
        ),
    ]
    return {row.name: row for row in rows}
