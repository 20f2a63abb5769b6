"""Which mechanism makes which error: each of them alone on a bench that has no other.

Every mechanism is switched on alone on the bench ``clean``; cases 1 to 4 follow reference A
without and with pulses, and the dissertation's method (2.2.3) estimates every pulse.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import prod
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from jointz.analysis.analyze import analyze
from jointz.core.events import PulseEstimate
from jointz.core.protocols.protocol import Protocol
from jointz.io.protocols import load_protocol
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study
from jointz.kernels.bounded_lsq import least_squares, normal_equations
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.rig.session.participant_run import run_participant
from jointz.rig.session.run import NoOperator
from jointz.rig.session.run_settings import RunSettings
from jointz.rig.session.study_file import study_toml
from jointz.rig.sim.benches.bench_load import draw_load
from jointz.rig.sim.benches.sea import sea_preset
from jointz.rig.sim.benches.sea_bench_rig import SeaBench
from reproduction import printed_numbers
from reproduction.chapter2_loads import PARAMETERS, error_pct
from reproduction.reproduction_tables import ComparedTable, compare, compared_table

_UNITS = {"stiffness": "%", "damping": "N*m*s/rad", "inertia": "%"}
_WINDOW_S = 0.1
#: A mechanism's error is near a printed one within this many percentage points.
_NEAR_PCT = 2.0


@dataclass(frozen=True, slots=True)
class Mechanism:
    """One way to be wrong."""

    name: str  # name in tables and figures
    # field of :class:`jointz.rig.sim.benches.sea.SeaErrors` -> value
    errors: Mapping[str, Any] = field(default_factory=dict)
    window_filter_hz: float = 0.0  # zero-phase low-pass inside the cut window; 0: none


def mechanisms() -> tuple[Mechanism, ...]:
    """Return every mechanism with the size that the bench ``nominal`` has, where it has it."""
    nominal = sea_preset("nominal").errors
    return (
        Mechanism("no error"),
        Mechanism("torque record 2.2 ms late", {"torque_lag_s": nominal.torque_lag_s}),
        Mechanism("torque record low-passed at 45 Hz", {"torque_filter_hz": 45.0}),
        Mechanism("zero-phase 20 Hz filter inside the window", window_filter_hz=20.0),
        Mechanism("loop 7.5 % slower than 900 Hz", {"clock_stretch": 1.081, "true_stamps": False}),
        Mechanism(
            f"bearing friction {nominal.coulomb_friction_nm:g} N*m",
            {"coulomb_friction_nm": nominal.coulomb_friction_nm},
        ),
        Mechanism(
            f"beam {-100 * nominal.beam_error:g} % stiffer than believed",
            {"beam_error": nominal.beam_error},
        ),
        Mechanism(
            "encoder steps, noise, jitter with true stamps",
            {
                "torque_noise_nm": nominal.torque_noise_nm,
                "angle_noise_rad": nominal.angle_noise_rad,
                "linear_step_m": nominal.linear_step_m,
                "rotary_step_rad": nominal.rotary_step_rad,
                "clock_jitter_s": nominal.clock_jitter_s,
            },
        ),
    )


def mechanism_errors(mechanism: Mechanism, *, seed: int) -> dict[str, float]:
    """Return what a mechanism alone does to K, B and J, means over cases 1 to 4."""
    protocol = _protocol()
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder)
        _record(study, protocol, mechanism, seed)
        opened = open_study(study)
        single = analyze(opened, method="dissertation", resamples=2, seed=seed).single
        if mechanism.window_filter_hz:
            trials = {
                (entry.participant, entry.condition): read_recording(opened, entry)[0]
                for entry in opened.spec.recordings
            }
            single = tuple(
                estimate
                for load in protocol.loads
                for estimate in _filtered_in_window(
                    trials[load.name, "unperturbed"],
                    trials[load.name, "perturbed"],
                    load=load.name,
                    cutoff_hz=mechanism.window_filter_hz,
                    onsets_s=[p.onset_s for p in single if p.participant == load.name],
                )
            )
    return _errors(protocol, single)


def mechanism_table(errors: Mapping[str, Mapping[str, float]]) -> ComparedTable:
    """Return what every mechanism alone does."""
    rows = [
        compare(f"{name}: {parameter}", _UNITS[parameter], dissertation=value)
        for name, values in errors.items()
        for parameter, value in values.items()
    ]
    return compared_table(2, "mechanisms", rows, alike=_alike(errors))


def _alike(errors_of: Mapping[str, Mapping[str, float]]) -> str:
    """Say which mechanisms, alone or in pairs, make both printed averages (2.3.2)."""
    printed = {
        "stiffness": [
            printed_numbers.AVERAGE_ERRORS[name].value for name in printed_numbers.SPRINGS
        ],
        "inertia": [
            printed_numbers.AVERAGE_ERRORS[name].value for name in printed_numbers.INERTIAS
        ],
    }
    causes = [name for name, errors in errors_of.items() if any(errors.values())]
    tried = {
        names: {key: _together([errors_of[name][key] for name in names]) for key in printed}
        for count in (1, 2)
        for names in combinations(causes, count)
    }
    near = [
        f"{' with '.join(names)} (stiffness {errors['stiffness']:+.1f} %, "
        f"inertia {errors['inertia']:+.1f} %)"
        for names, errors in tried.items()
        if all(
            min(values) - _NEAR_PCT <= errors[key] <= max(values) + _NEAR_PCT
            for key, values in printed.items()
        )
    ]
    ranges = " and ".join(
        f"{key} {max(values):.3g} to {min(values):.3g} %" for key, values in printed.items()
    )
    text = f"Printed averages (2.3.2): {ranges}. Within {_NEAR_PCT:g} points of both"
    if len(near) < 2:
        return f"{text}, of all of them alone and in pairs, comes {near[0] if near else 'none'}."
    return (
        f"{text} come, alone or one on top of the other: {'; '.join(near)}. Two averages cannot "
        "tell them apart, and sizes other than these would do as well."
    )


def _together(errors_pct: Sequence[float]) -> float:
    """Return the error of gains that are wrong one on top of the other, %."""
    return 100.0 * (prod(1.0 + error / 100.0 for error in errors_pct) - 1.0)


def _protocol() -> Protocol:
    """Return reference A of the mass-spring experiment, one trial each, without the damper."""
    whole = load_protocol("sea-mass-spring")
    conditions = tuple(
        c.model_copy(update={"trials": 1}) for c in whole.conditions if c.session == "A"
    )
    loads = tuple(load for load in whole.loads if load.damping is None)
    return whole.model_copy(update={"conditions": conditions, "loads": loads})


def _record(study: Path, protocol: Protocol, mechanism: Mechanism, seed: int) -> None:
    clean = sea_preset("clean")
    bench = replace(clean, errors=replace(clean.errors, **mechanism.errors))
    settings = RunSettings(protocol, seed, "fast", study)
    rigs = [
        SeaBench(
            bench,
            draw_load(load, seed=seed, spread=False),
            seed=seed,
            sample_rate_hz=protocol.rates.sample_hz,
        )
        for load in protocol.loads
    ]
    report: dict[str, Any] = {}
    for rig in rigs:
        report = run_participant(rig, settings, operator=NoOperator(), progress=_silent)
    known = [rig.calibration for rig in rigs]
    text = study_toml(protocol, rigs, known, None, devices=report["devices"])
    (study / "study.toml").write_text(text, encoding="utf-8")


def _silent(trial: str, strides: int, done: int, planned: int) -> None:
    del trial, strides, done, planned


def _filtered_in_window(
    unperturbed: Any, perturbed: Any, *, load: str, cutoff_hz: float, onsets_s: list[float]
) -> list[PulseEstimate]:
    """Estimate pulses whose responses are filtered after they were cut."""
    time = perturbed["time"].to_numpy()
    rate_hz = (time.size - 1) / (time[-1] - time[0])
    difference = {
        name: perturbed[name].to_numpy() - unperturbed[name].to_numpy()
        for name in ("angle", "torque")
    }
    n = round(_WINDOW_S * rate_hz)
    windows = []
    for onset in np.searchsorted(time, onsets_s):
        angle, torque = (
            lowpass_zero_phase(
                difference[name][onset : onset + n], cutoff_hz=cutoff_hz, rate_hz=rate_hz
            )
            for name in ("angle", "torque")
        )
        velocity = derivative(angle, rate_hz=rate_hz)
        windows.append([angle, velocity, derivative(velocity, rate_hz=rate_hz), torque])
    gram, moment, _ = normal_equations(np.array(windows))
    return [
        PulseEstimate(load, "A", "", "", onset, 1, "", float(k), float(b), float(j), vaf_pct=np.nan)
        for onset, (k, b, j) in zip(onsets_s, least_squares(gram, moment), strict=True)
    ]


def _errors(protocol: Protocol, single: tuple[PulseEstimate, ...]) -> dict[str, float]:
    machine = sea_preset("clean").machine
    errors: dict[str, list[float]] = {name: [] for name in PARAMETERS}
    for load in protocol.loads:
        true_load = draw_load(load, seed=0, spread=False)
        own = [p for p in single if p.participant == load.name]
        for name in PARAMETERS:
            value = fmean(getattr(p, name) for p in own) - getattr(machine, name)
            truth = getattr(true_load, name)
            errors[name].append(value if name == "damping" else error_pct(value, truth))
    return {name: fmean(values) for name, values in errors.items()}
