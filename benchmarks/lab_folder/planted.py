"""Errors of a lab that has two clocks, a trigger and detected heel strikes, one at a time."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from benchmarks.lab_folder.simulation import Array, Person, Trial, find_edges

Fault = Callable[[Trial, np.random.Generator], Trial]


def plant(people: list[Person], name: str, seed: int) -> list[Person]:
    """Return the people with one error in all of their trials."""
    rng, planted = np.random.default_rng([seed, 7]), []
    for person in people:
        trials = {key: FAULTS[name](trial, rng) for key, trial in person.trials.items()}
        planted.append(replace(person, trials=trials))
    return planted


def _noise(volts: float) -> Fault:
    def add(trial: Trial, rng: np.random.Generator) -> Trial:
        extra = np.sqrt(volts**2 - 0.02**2) * rng.standard_normal(trial.trigger_v.size)
        return replace(trial, trigger_v=trial.trigger_v + extra)

    return add


def _bounce(trial: Trial, _rng: np.random.Generator) -> Trial:
    """Three rising edges within 6 ms: high for 1 ms, low for 2, high for 1, low for 2, high."""
    trigger = trial.trigger_v.copy()
    for edge in np.searchsorted(trial.daq_s, find_edges(trial.daq_s, trigger)[0]):
        for low in (edge + 1, edge + 2, edge + 4, edge + 5):
            trigger[low] -= 5.0
    return replace(trial, trigger_v=trigger)


def _strikes(change: Callable[[Array, np.random.Generator], Array]) -> Fault:
    def alter(trial: Trial, rng: np.random.Generator) -> Trial:
        return replace(trial, strikes_s=np.sort(change(trial.strikes_s, rng)))

    return alter


def _choose(strikes: Array, rng: np.random.Generator) -> Array:
    return rng.choice(strikes.size, round(0.05 * strikes.size), replace=False)


def _double(strikes: Array, rng: np.random.Generator) -> Array:
    chosen = strikes[_choose(strikes, rng)]
    return np.r_[strikes, chosen + rng.uniform(0.03, 0.08, chosen.size)]


def _other_leg(strikes: Array, _rng: np.random.Generator) -> Array:
    return strikes[:-1] + np.diff(strikes) / 2


def _clocks(ppm: float = 0.0, offset_s: float = 0.0) -> Fault:
    def alter(trial: Trial, _rng: np.random.Generator) -> Trial:
        return replace(trial, angle_rate_error=ppm * 1e-6, angle_offset_s=offset_s)

    return alter


FAULTS: dict[str, Fault] = {
    "trigger_noise_20mV": lambda trial, _rng: trial,  # no error: the lab's usual noise
    "trigger_noise_100mV": _noise(0.1),
    "trigger_noise_200mV": _noise(0.2),
    "trigger_bounce": _bounce,
    "trigger_drift_1V": lambda trial, _rng: replace(
        trial, trigger_v=trial.trigger_v + np.linspace(0, 1, trial.trigger_v.size)
    ),
    "strikes_doubled": _strikes(_double),
    "strikes_missing": _strikes(lambda strikes, rng: np.delete(strikes, _choose(strikes, rng))),
    "strikes_other_leg": _strikes(_other_leg),
    "strikes_both_legs": _strikes(lambda strikes, rng: np.r_[strikes, _other_leg(strikes, rng)]),
    "clocks_50ppm": _clocks(ppm=50),
    "clocks_200ppm": _clocks(ppm=200),
    "clocks_500ppm": _clocks(ppm=500),
    "angle_20ms_late": _clocks(offset_s=0.02),
    "angle_20ms_early": _clocks(offset_s=-0.02),
}
