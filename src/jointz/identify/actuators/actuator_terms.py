"""Terms of the torque models 3.1 to 3.3, and those that a record can tell apart."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jointz.identify.actuators.actuator_record import ActuatorRecord
from jointz.identify.bench.bench_estimates import is_constant

#: Model -> its parameters. The order is that of rank: where two terms cannot be told apart,
#: the later one is left out.
MODEL_TERMS: Mapping[str, tuple[str, ...]] = {
    "current": ("bias", "torque_constant"),
    "motor": ("bias", "torque_constant", "viscous_friction", "rotor_inertia"),
    "friction": ("bias", "torque_constant", "coulomb_friction", "gear_friction", "rotor_inertia"),
}

#: A term whose regressor is explained by the others but for this share of its variance is left
#: out: its standard error would be 30 times that of the term alone.
_LEAST_OWN_SHARE = 1e-3
#: A velocity has reversed where it spends this share of the samples in each direction, faster
#: than so many tenths of the 95th percentile of the speed.
_LEAST_REVERSED_SHARE = 0.01
_DEAD_BAND_SHARE = 0.05
#: Largest share of noise in a differenced velocity: the inertia reads low by as much.
MOST_NOISE_SHARE = 0.1
#: Terms that turn with the speed's sign.
_WITH_SIGN = ("coulomb_friction", "gear_friction")


@dataclass(frozen=True, slots=True)
class Terms:
    """The terms that are fitted, and why the others are not."""

    # parameter -> its regressor: torque = sum of parameter * column
    columns: Mapping[str, np.ndarray]
    left_out: Mapping[str, str]  # parameter -> why the record does not support it

    def without(self, name: str, why: str) -> "Terms":
        """Return the terms less one."""
        columns = {n: column for n, column in self.columns.items() if n != name}
        return Terms(columns, {**self.left_out, name: why})


def find_terms(
    record: ActuatorRecord,
    model: str,
    *,
    gear_ratio: float,
    smooth_velocity_rad_s: float | None,
    skip: tuple[str, ...] = (),
) -> Terms:
    """Return the terms of a model that the record supports."""
    left_out: dict[str, str] = {}
    kept: dict[str, np.ndarray] = {}
    for name in MODEL_TERMS[model]:
        if name in skip:
            continue
        why = _missing(record, name, smooth_velocity_rad_s)
        if not why:
            column = _regressor(record, name, gear_ratio, smooth_velocity_rad_s)
            why = _confounded(column, kept) if kept else ""
        if why:
            left_out[name] = why
        else:
            kept[name] = column
    return Terms(kept, left_out)


def _regressor(
    record: ActuatorRecord, name: str, gear_ratio: float, smooth: float | None
) -> np.ndarray:
    """Return the factor of a parameter in 3.1 to 3.3."""
    zeros = np.zeros_like(record.torque)
    velocity = zeros if record.velocity is None else record.velocity
    acceleration = zeros if record.acceleration is None else record.acceleration
    sign = np.sign(velocity) if smooth is None else np.tanh(velocity / smooth)
    regressors: dict[str, np.ndarray] = {
        "bias": np.ones_like(record.torque),
        "torque_constant": gear_ratio * record.current,
        "viscous_friction": -velocity,
        "coulomb_friction": -sign,
        "gear_friction": -np.abs(record.current) * sign,
        "rotor_inertia": -acceleration,
    }
    return regressors[name]


def _missing(record: ActuatorRecord, name: str, smooth: float | None) -> str:
    """Return why a term is not identifiable from the record, "" if it is."""
    if name == "rotor_inertia":
        return _missing_acceleration(record)
    if smooth is not None and record.velocity is not None and name in _WITH_SIGN:
        fastest = float(np.quantile(np.abs(record.velocity), 0.95))
        if fastest < smooth:
            return (
                f"the speed, up to {fastest:.3g} rad/s, never passes smooth_velocity_rad_s "
                f"({smooth:g}): tanh is then a line through zero, and no friction that only "
                "turns its sign. Lower it (--smooth-velocity)"
            )
    if name == "coulomb_friction" and record.velocity is not None:
        share = _reversed_share(record.velocity)
        if share < _LEAST_REVERSED_SHARE:
            return (
                f"the speed does not reverse ({100 * share:.1f} % of the samples lie on the rarer "
                "side), so friction cannot be told from the bias, which then holds both. Record "
                "both directions"
            )
    return ""


def _missing_acceleration(record: ActuatorRecord) -> str:
    if record.acceleration_from == "none":
        return (
            "acceleration cannot be fitted: the record has none, nor an even time or rate to "
            "difference the speed. Give acceleration, or time or rate, or the inertia itself"
        )
    if record.acceleration_noise_share > MOST_NOISE_SHARE:
        return (
            f"acceleration cannot be fitted: about {100 * record.acceleration_noise_share:.0f} % "
            "of the variance of the differenced speed is noise (quantisation), above "
            f"{100 * MOST_NOISE_SHARE:.0f} %. Give a measured acceleration, or the inertia itself"
        )
    return ""


def rest_share(velocity: np.ndarray) -> float:
    """Return the share of the samples inside the dead band, of a record that moves."""
    return float(np.mean(np.abs(velocity) <= _dead_band(velocity)))


def _dead_band(velocity: np.ndarray) -> float:
    return _DEAD_BAND_SHARE * float(np.quantile(np.abs(velocity), 0.95))


def _reversed_share(velocity: np.ndarray) -> float:
    """Return the share of the samples in the rarer direction, outside a dead band of noise."""
    dead_band = _dead_band(velocity)
    return float(min(np.mean(velocity > dead_band), np.mean(velocity < -dead_band)))


def _confounded(column: np.ndarray, kept: Mapping[str, np.ndarray]) -> str:
    """Return which kept term explains this one, "" if none does."""
    if is_constant(column):
        return "what it multiplies is constant in this record, as the bias is"
    centred = column - column.mean()
    others = {name: c - c.mean() for name, c in kept.items() if not is_constant(c)}
    if not others:
        return ""
    basis = np.stack([c / np.linalg.norm(c) for c in others.values()], axis=1)
    weights = np.linalg.lstsq(basis, centred, rcond=None)[0]
    own_share = np.linalg.norm(centred - basis @ weights) ** 2 / np.linalg.norm(centred) ** 2
    if own_share >= _LEAST_OWN_SHARE:
        return ""
    rival = list(others)[int(np.argmax(np.abs(weights)))]
    return (
        f"it cannot be told from {rival}, which then holds both: only {100 * own_share:.2g} % of "
        "its regressor's variance is its own. Vary torque and speed independently, in both "
        "directions"
    )
