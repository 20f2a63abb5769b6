"""Files and study.toml of each form in which a lab keeps the same trials."""

from collections.abc import Callable
from functools import partial
from importlib.resources import files
from pathlib import Path

import ezc3d
import numpy as np
import pandas as pd
from benchmarks.lab_folder import simulation as sim
from benchmarks.lab_folder.simulation import Array, Person, Trial
from scipy.io import savemat
from scipy.signal import butter, sosfiltfilt

CSV_OFFSET_S = 0.4  # the motion capture of the form csv starts later, at its own time 0
C3D_EVENTS, C3D_POINT_HZ, C3D_ANALOG_HZ = 255, 200, 1000  # more events a file cannot have


def write_study(form: str, people: list[Person], folder: Path, seed: int = 0) -> None:
    """Write recordings and study.toml of one form."""
    folder.mkdir(parents=True)
    entries = []
    for number, person in enumerate(people):
        rng = np.random.default_rng([seed, number, list(WRITERS).index(form)])
        entries += [f'[[participants]]\nid = "{person.id}"\nmass_kg = {person.mass_kg}']
        for condition, keys in zip(person.trials, WRITERS[form](person, folder, rng), strict=True):
            who = f'participant = "{person.id}"\ncondition = "{condition}"\nside = "right"'
            entries += [f"[[recordings]]\n{who}\n{keys}"]
    points = ", ".join(f"{name} = {pct}" for name, pct in sim.POINTS.items())
    lag = f"[calibration]\nangle_lag_s = {{ value = {sim.LAG_S}, sd = {sim.LAG_SD_S} }}\n\n"
    text = files(__package__).joinpath("templates", f"{form}.toml").read_text()
    text = text.replace("@POINTS@", f"timing_points = {{ {points} }}")
    # Both ways in which a study may name the heel strikes of a leg
    text = text.replace("@STRIKE@", ("Right Foot Strike", "Foot Strike")[seed % 2])
    (folder / "study.toml").write_text(text.replace("@TAIL@", lag + "\n".join(entries)))


def write_mat(person: Person, folder: Path, rng: np.random.Generator) -> list[str]:
    """One .mat a participant: a struct array of trials."""
    fields = [(name, object) for name in ("name", "mocap", "daq", "events")]
    trials = np.empty(len(person.trials), dtype=fields)
    for k, (name, trial) in enumerate(person.trials.items()):
        stamps, angle = trial.sample_angle(240, rng)
        daq = {"time": trial.daq_s, "motorCurrent": trial.current_a}
        daq["pulseTrigger"] = trial.trigger_v
        events = {"heelStrike": trial.strikes_s}
        trials[k] = (name, {"time": stamps, "kneeAngle": angle}, daq, events)
    content = {"subject": {"id": person.id, "mass": person.mass_kg}, "trial": trials}
    savemat(folder / f"{person.id}.mat", content, do_compression=True, oned_as="column")
    return [f'file = "{person.id}.mat"\npart = "{k}"' for k in range(1, len(trials) + 1)]


def write_csv(person: Person, folder: Path, rng: np.random.Generator) -> list[str]:
    """Three tables a trial: motion capture, DAQ, heel strikes."""
    keys = []
    for name, trial in person.trials.items():
        stem = f"{person.id}_{name}"
        stamps, angle = trial.sample_angle(240, rng)
        late = stamps >= CSV_OFFSET_S
        mocap = {"time_s": stamps[late] - CSV_OFFSET_S, "knee_extension_deg": angle[late]}
        daq = {"t_s": trial.daq_s, "motor_current_A": trial.current_a, "sync_V": trial.trigger_v}
        _write_table(folder / f"{stem}_mocap.csv", mocap)
        _write_table(folder / f"{stem}_daq.csv", daq)
        _write_table(folder / f"{stem}_strikes.csv", {"heel_strike_s": trial.strikes_s})
        keys.append(
            f'file = "{stem}_daq.csv"\nheel_strikes = "{stem}_strikes.csv"\n'
            f'[[recordings.joined]]\nfile = "{stem}_mocap.csv"\noffset_s = {CSV_OFFSET_S}\n'
            "[recordings.joined.channels]\n"
            'time = { column = "time_s", unit = "s" }\n'
            'angle = { column = "knee_extension_deg", unit = "deg", positive = "extension" }\n'
        )
    return keys


def write_c3d(person: Person, folder: Path, rng: np.random.Generator) -> list[str]:
    """One C3D a trial; the left leg's strikes are in it if the file has room for them."""
    keys = []
    for name, trial in person.trials.items():
        strikes = trial.strikes_s[:C3D_EVENTS]
        stamps, angle = trial.sample_angle(C3D_POINT_HZ, rng)
        if strikes.size < trial.strikes_s.size:  # of a longer trial the first part
            stamps = stamps[stamps < strikes[-1]]
        analog = np.arange(stamps.size * C3D_ANALOG_HZ // C3D_POINT_HZ) / C3D_ANALOG_HZ
        points = np.zeros((4, 1, stamps.size))
        points[0, 0] = angle[: stamps.size]
        signals = [np.interp(analog, trial.daq_s, x) for x in (trial.current_a, trial.trigger_v)]
        content = ezc3d.c3d()
        content["data"]["points"], content["data"]["analogs"] = points, np.array(signals)[None]
        content.add_parameter("POINT", "RATE", [float(C3D_POINT_HZ)])
        content.add_parameter("POINT", "UNITS", ["mm"])
        content.add_parameter("POINT", "ANGLE_UNITS", ["deg"])
        for names in ("LABELS", "ANGLES"):
            content.add_parameter("POINT", names, ["RKneeAngles"])
        content.add_parameter("ANALOG", "RATE", [float(C3D_ANALOG_HZ)])
        content.add_parameter("ANALOG", "LABELS", ["Motor.Current", "Pulse.Sync"])
        content.add_parameter("ANALOG", "UNITS", ["A", "V"])
        _add_events(content, strikes)
        content.write(str(folder / f"{person.id}_{name}.c3d"))
        keys.append(f'file = "{person.id}_{name}.c3d"')
    return keys


def _add_events(content: ezc3d.c3d, strikes: Array) -> None:
    events = [(time, "Right") for time in strikes]
    if 2 * strikes.size <= C3D_EVENTS:
        events += [(time, "Left") for time in strikes[:-1] + np.diff(strikes) / 2]
    events.sort()
    times = np.array([time for time, _ in events])
    content.add_parameter("EVENT", "USED", [len(events)])
    content.add_parameter("EVENT", "CONTEXTS", [side for _, side in events])
    content.add_parameter("EVENT", "LABELS", ["Foot Strike"] * len(events))
    content.add_parameter("EVENT", "TIMES", np.array([times // 60, times % 60]))


def write_log(person: Person, folder: Path, rng: np.random.Generator, *, rate_hz: int) -> list[str]:
    """One table a trial with all signals at one rate, and a table of its pulses."""
    keys = []
    for name, trial in person.trials.items():
        stem = f"{person.id}_{name}"
        times, angle = trial.sample_angle(rate_hz, rng)
        log = {
            "t_s": times,
            "knee_extension_deg": angle,
            "motor_current_A": _resample(trial, trial.current_a, times, rate_hz),
            "stride": np.searchsorted(trial.strikes_s, times, side="right"),
        }
        _write_table(folder / f"{stem}.csv", log)
        keys.append(f'file = "{stem}.csv"')
        trigger = _resample(trial, trial.trigger_v, times, rate_hz)
        onsets, durations = sim.find_edges(times, trigger)
        if onsets.size:
            pulses = {"onset_s": onsets, "duration_s": durations}
            _write_table(folder / f"{stem}_pulses.csv", pulses)
            keys[-1] += f'\nperturbations = "{stem}_pulses.csv"'
    return keys


def _resample(trial: Trial, signal: Array, times: Array, rate_hz: int) -> Array:
    """Return a signal of the DAQ at other times, low-passed if the rate is lower."""
    if rate_hz < 1000:
        signal = sosfiltfilt(butter(4, 0.375 * rate_hz, fs=1000, output="sos"), signal)
    return np.interp(times, trial.daq_s, signal)


def _write_table(path: Path, columns: dict[str, Array]) -> None:
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.5f")


WRITERS: dict[str, Callable[[Person, Path, np.random.Generator], list[str]]] = {
    "mat": write_mat,
    "csv": write_csv,
    "c3d": write_c3d,
    "one_clock": partial(write_log, rate_hz=1000),
    "slow_angle": partial(write_log, rate_hz=240),
}
