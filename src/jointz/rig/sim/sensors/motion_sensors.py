r"""The device's encoder, and gyroscopes on shank and thigh, sample by sample.

A gyroscope on soft tissue turns at the rate y where the bone turns at the rate u:
:math:`\ddot y = \omega^2 (u - y) + 2\zeta\omega(\dot u - \dot y)`, tissue being a spring and a
damper in parallel. Between two samples u is the cubic through its values and slopes, for which
the step is exact. A lag is a pure delay; the record is taken from the cubic between samples.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import IntEnum
from math import exp, pi, sqrt

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from jointz.core.channels import MOTION_SENSORS
from jointz.core.errors import DataError
from jointz.core.study import Calibrated
from jointz.rig.sim.people import Person, within_errors
from jointz.rig.sim.presets import Preset
from jointz.rig.sim.sensors.sensor_settings import (
    SENSORS,
    EncoderSettings,
    GyroscopeSettings,
    Range,
    checked_sensors,
)
from jointz.rig.sim.walking.impedance_curves import impedance_over_cycle, thigh_share
from jointz.rig.sim.walking.layout import CURVE_PIECES, Param, State
from jointz.rig.sim.walking.path import phase_at
from jointz.rig.sim.walking.plant import MotorMeasured, advance
from jointz.rig.sim.walking.plant_build import Grid, PlantBuild

_ENCODER, _SHANK, _THIGH = range(3)  # rows of all arrays, as in MOTION_SENSORS
_RING = 64  # samples kept: more than any delay; a power of two
_NOISES = 6  # columns of a block of standard normal numbers, a row a sample
_compiled = njit(cache=True, nogil=True, error_model="numpy")


class _Param(IntEnum):
    """Constants of a sensor."""

    MOUNTED = 0  # 1 on tissue, 0 where the mount is rigid
    GAIN = 1
    DELAY = 2  # samples
    STEP = 3  # quantum, 0: none
    WHITE = 4  # sd
    BIAS_KEEP = 5  # per sample
    BIAS_DRIVE = 6
    PERIOD_S = 7
    DAMPING = 8  # 2 zeta omega
    MOUNT = 9  # 2 x 6 matrix of a step


class _State(IntEnum):
    """State of a sensor."""

    BIAS = 0
    SHOWN = 1  # y, and then dy/dt - 2 zeta omega (u - y)
    PULL = 2
    TRUE = 3  # u and its slope at the sample before
    SLOPE = 4
    RING = 5  # of y and its slope


@dataclass(frozen=True, slots=True)
class MotionInstrument:
    """True properties of an encoder or a gyroscope of one person; the same in all conditions."""

    gain: float  # measured over true
    lag_s: float  # s: pure delay behind joint or segment; the mount comes on top
    mount_hz: float = 0.0  # Hz: resonance on its tissue; 0: rigid
    mount_damping: float = 0.0  # damping ratio of that resonance


def with_sensors(preset: Preset, sensors: Iterable[str] | None) -> Preset:
    """Return a preset with these sensors and no others; None: those that it has."""
    if sensors is None:
        return preset
    wanted = checked_sensors(sensors)
    return replace(
        preset,
        encoder=preset.encoder or EncoderSettings() if SENSORS[1] in wanted else None,
        gyroscopes=preset.gyroscopes or GyroscopeSettings() if SENSORS[2] in wanted else None,
    )


def draw_motion_instruments(person: Person, preset: Preset) -> dict[str, MotionInstrument]:
    """Draw the errors of a person's encoder and gyroscopes: channel -> instrument."""
    found = {}
    if preset.encoder is not None:
        encoder = preset.encoder
        lag_s = _between(person, "encoder lag", encoder.lag_range_s)
        gain = 1.0 + encoder.gain_error_sd * _error(person, "joint_encoder gain")
        found["joint_encoder"] = MotionInstrument(gain, lag_s)
    if preset.gyroscopes is not None:
        gyroscopes = preset.gyroscopes
        lag_s = _between(person, "gyroscope lag", gyroscopes.lag_range_s)
        mount = gyroscopes.mount_range_hz
        for name in MOTION_SENSORS[1:]:
            found[name] = MotionInstrument(
                1.0 + gyroscopes.gain_error_sd * _error(person, f"{name} gain"),
                lag_s,
                _between(person, f"{name} mount", mount) if mount else 0.0,
                _between(person, f"{name} mount damping", gyroscopes.mount_damping_range),
            )
    return found


def known_of_sensors(person: Person, preset: Preset) -> dict[str, Calibrated]:
    """Return what the lab knows about encoder and gyroscopes: gains, and lags if synchronised."""
    known = {}
    for name, true in draw_motion_instruments(person, preset).items():
        settings = preset.encoder if name == "joint_encoder" else preset.gyroscopes
        if settings is None:
            continue
        if settings.gain_error_sd > 0.0:
            known[f"{name}_gain"] = Calibrated(value=1.0, sd=settings.gain_error_sd)
        if settings.synchronised_sd_s is not None:
            error_s = settings.synchronised_sd_s * _error(person, f"{name} lag as known")
            lag = Calibrated(value=true.lag_s + error_s, sd=settings.synchronised_sd_s)
            known[f"{name}_lag_s"] = lag
    return known


def own_clock(person: Person, preset: Preset) -> tuple[float, float]:
    """Return zero (s) and relative error of the rate of the clock of a person's gyroscopes."""
    settings = preset.gyroscopes
    if settings is None:
        return 0.0, 0.0
    rate = settings.clock_rate_sd * _error(person, "gyroscope clock rate")
    return _between(person, "gyroscope clock zero", settings.clock_zero_range_s), rate


class MotionSensors:
    """Encoder and gyroscopes of one stretch; purpose and segment seed their noise."""

    def __init__(self, build: PlantBuild, *, purpose: str, segment: int) -> None:
        instruments = draw_motion_instruments(build.person, build.preset)
        if not build.worn:
            instruments.pop("joint_encoder", None)
        #: Channels that are measured.
        self.channels = tuple(name for name in MOTION_SENSORS if name in instruments)
        params = np.zeros((3, _Param.MOUNT + 12))
        state = np.zeros((3, _State.RING + 2 * _RING))
        curves = _segment_curves(build)
        self._rng = build.person.stream(f"motion sensor noise {purpose}", segment)
        for name, instrument in instruments.items():
            row = MOTION_SENSORS.index(name)
            _fill(params[row], instrument, build.preset, build.grid, encoder=row == _ENCODER)
        settings = build.preset.gyroscopes
        if settings is not None:
            first = build.person.stream(f"gyroscope bias {purpose}", segment).standard_normal(2)
            state[_SHANK:, _State.BIAS] = settings.bias_sd_rad_s * first
        #: Constants, state and curves, as the compiled step takes them.
        self.arrays = params, state, curves

    def noise(self, n: int) -> np.ndarray:
        """Return the random numbers of the next samples; none without sensors."""
        return self._rng.standard_normal((n if self.channels else 0, _NOISES))


def _fill(
    params: np.ndarray, true: MotionInstrument, preset: Preset, grid: Grid, *, encoder: bool
) -> None:
    params[_Param.GAIN], params[_Param.PERIOD_S] = true.gain, grid.period_s
    params[_Param.DELAY] = true.lag_s / grid.period_s
    if params[_Param.DELAY] > _RING - 2:
        raise DataError(
            f"simulated rig: a lag of {true.lag_s:g} s is too long for {grid.sample_rate_hz:g} Hz. "
            "Use a shorter one."
        )
    if encoder:
        if preset.encoder is not None:
            params[_Param.STEP] = preset.encoder.step_rad
            params[_Param.WHITE] = preset.encoder.white_sd_rad
        return
    settings = preset.gyroscopes
    if settings is None:
        return
    params[_Param.WHITE] = settings.white_sd_rad_s
    keep = exp(-grid.period_s / settings.bias_time_s)
    params[_Param.BIAS_KEEP] = keep
    params[_Param.BIAS_DRIVE] = settings.bias_sd_rad_s * sqrt(1.0 - keep**2)
    if true.mount_hz > 0.0:
        omega = 2.0 * pi * true.mount_hz
        params[_Param.MOUNTED] = 1.0
        params[_Param.DAMPING] = 2.0 * true.mount_damping * omega
        params[_Param.MOUNT :] = _mount_step(omega, true.mount_damping, grid.period_s).ravel()


def _mount_step(omega: float, zeta: float, period_s: float) -> np.ndarray:
    """Return the 2 x 6 matrix to the next y and pull from the present ones and u, slope at both."""
    damping, square = 2.0 * zeta * omega, omega**2
    # Over the share of the period, with the coefficients of the cubic as four more states.
    system = np.zeros((6, 6))
    system[0, :3] = -damping, 1.0, damping
    system[1, :3] = -square, 0.0, square
    system[:2] *= period_s
    system[2, 3], system[3, 4], system[4, 5] = 1.0, 2.0, 3.0
    to_cubic = np.array(
        [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, period_s, 0.0, 0.0],
            [-3.0, -2.0 * period_s, 3.0, -period_s],
            [2.0, period_s, -2.0, period_s],
        ]
    )
    step = expm(system)[:2]
    return np.hstack([step[:, :2], step[:, 2:] @ to_cubic])


def _segment_curves(build: PlantBuild) -> np.ndarray:
    """Return thigh and share of the thigh as cubics with two derivatives, piece by piece."""
    at = np.arange(CURVE_PIECES + 1) / CURVE_PIECES
    within = np.mod(at, 1.0)
    person, preset = build.person, build.preset
    thigh = impedance_over_cycle(person, preset, within)[3]
    curves = thigh, thigh_share(person, preset, within, build.load)
    splines = [CubicSpline(at, values, bc_type="periodic") for values in curves]
    return np.ascontiguousarray(np.vstack([spline.c[::-1] for spline in splines]).T)


@_compiled
def _curve(curves: np.ndarray, first: int, phase: float) -> tuple[float, float, float]:
    """Return a curve over the cycle and its derivatives by phase; ``first`` is its column."""
    cycle = phase - math.floor(phase)
    piece = min(int(cycle * CURVE_PIECES), CURVE_PIECES - 1)
    r = cycle - piece / CURVE_PIECES
    c0, c1 = curves[piece, first], curves[piece, first + 1]
    c2, c3 = curves[piece, first + 2], curves[piece, first + 3]
    value = c0 + r * (c1 + r * (c2 + r * c3))
    return value, c1 + r * (2.0 * c2 + r * 3.0 * c3), 2.0 * c2 + r * 6.0 * c3


@_compiled
def _moving(
    curves: np.ndarray, plant: np.ndarray, phase: tuple[float, float, float]
) -> tuple[float, float]:
    """Return rate and acceleration of the thigh in the sense in which the shank flexes."""
    at, rate, bend = phase
    _, thigh_1, thigh_2 = _curve(curves, 0, at)
    share, share_1, share_2 = _curve(curves, 4, at)
    x, v, a = plant[State.ANGLE], plant[State.VELOCITY], plant[State.ACCELERATION]
    share_rate, share_bend = share_1 * rate, share_2 * rate * rate + share_1 * bend
    velocity = -thigh_1 * rate - share * v - share_rate * x
    acceleration = -thigh_2 * rate * rate - thigh_1 * bend
    acceleration -= share * a + 2.0 * share_rate * v + share_bend * x
    return velocity, acceleration


@_compiled
def _delayed(p: np.ndarray, s: np.ndarray, sample: int) -> float:
    """Return y, a pure delay ago; before the first sample as at the first."""
    at = max(sample - p[_Param.DELAY], 0.0)
    before = int(at)
    r = at - before
    i = _State.RING + 2 * (before & (_RING - 1))
    if r == 0.0:
        return float(s[i])
    j = _State.RING + 2 * ((before + 1) & (_RING - 1))
    T = p[_Param.PERIOD_S]
    rise, m0, m1 = s[j] - s[i], s[i + 1] * T, s[j + 1] * T
    return float(s[i] + r * (m0 + r * (3.0 * rise - 2.0 * m0 - m1 + r * (m0 + m1 - 2.0 * rise))))


@_compiled
def _show(
    p: np.ndarray, s: np.ndarray, sample: int, motion: tuple[float, float], noise: np.ndarray
) -> float:
    """Return what a sensor shows of a motion and its slope; ``noise`` is white and bias."""
    u, slope = motion
    if sample > 0 and p[_Param.MOUNTED] > 0.0:
        y, pull, m = s[_State.SHOWN], s[_State.PULL], _Param.MOUNT
        for row in range(2):
            k = m + 6 * row
            s[_State.SHOWN + row] = (
                p[k] * y
                + p[k + 1] * pull
                + p[k + 2] * s[_State.TRUE]
                + p[k + 3] * s[_State.SLOPE]
                + p[k + 4] * u
                + p[k + 5] * slope
            )
    else:
        s[_State.SHOWN], s[_State.PULL] = u, slope
    s[_State.TRUE], s[_State.SLOPE] = u, slope
    i = _State.RING + 2 * (sample & (_RING - 1))
    s[i] = s[_State.SHOWN]
    s[i + 1] = s[_State.PULL] + p[_Param.DAMPING] * (u - s[_State.SHOWN])
    s[_State.BIAS] = p[_Param.BIAS_KEEP] * s[_State.BIAS] + p[_Param.BIAS_DRIVE] * noise[1]
    shown = p[_Param.GAIN] * _delayed(p, s, sample) + s[_State.BIAS] + p[_Param.WHITE] * noise[0]
    step = p[_Param.STEP]
    return float(shown if step == 0.0 else math.floor(shown / step + 0.5) * step)


@_compiled
def advance_and_measure(
    person: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    sensors: tuple[np.ndarray, np.ndarray, np.ndarray],
    gait: np.ndarray,
    noise: tuple[np.ndarray, np.ndarray],
    sample: int,
    command: float,
) -> tuple[MotorMeasured, float, float, tuple[float, float, float]]:
    """Advance a person to a sample and return motor, goniometer, true moment and motion sensors.

    ``person`` are constants, state, curves and history of the plant, ``sensors`` constants, state
    and curves; ``noise`` is that of both, the second empty where there are no motion sensors.
    """
    p, state, curves, history = person
    motor, angle = advance(p, state, curves, history, gait, noise[0], sample, command)
    motion = (math.nan, math.nan, math.nan)
    if noise[1].size > 0:
        row = noise[1][sample % noise[1].shape[0]]
        motion = _measure(sensors, p, state, gait, sample, row)
    return motor, angle, state[State.MOMENT], motion


@_compiled
def _measure(
    sensors: tuple[np.ndarray, np.ndarray, np.ndarray],
    p: np.ndarray,
    plant: np.ndarray,
    gait: np.ndarray,
    sample: int,
    noise: np.ndarray,
) -> tuple[float, float, float]:
    """Return encoder, shank and thigh at a sample that the plant has reached."""
    params, state, curves = sensors
    strapped = p[Param.STRAP_STIFFNESS] > 0.0
    angle = plant[State.EXO_ANGLE] if strapped else plant[State.ANGLE]
    rate = plant[State.EXO_VELOCITY] if strapped else plant[State.VELOCITY]
    encoder = plant[State.PATH] + angle, plant[State.PATH_RATE] + rate
    thigh = _moving(curves, plant, phase_at(gait, sample * p[Param.PERIOD_S]))
    shank = (
        plant[State.PATH_RATE] + plant[State.VELOCITY] + thigh[0],
        plant[State.PATH_ACCELERATION] + plant[State.ACCELERATION] + thigh[1],
    )
    return (
        _show(params[_ENCODER], state[_ENCODER], sample, encoder, noise[0:2]),
        _show(params[_SHANK], state[_SHANK], sample, shank, noise[2:4]),
        _show(params[_THIGH], state[_THIGH], sample, thigh, noise[4:6]),
    )


def _error(person: Person, purpose: str) -> float:
    deviation = float(person.stream(f"motion sensors {purpose}").standard_normal())
    return within_errors(deviation)


def _between(person: Person, purpose: str, limits: Range) -> float:
    share = float(person.stream(f"motion sensors {purpose}").random())
    return limits[0] + share * (limits[1] - limits[0])
