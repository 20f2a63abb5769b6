"""Third set: files of loggers, motion capture and MATLAB; clocks, headers and sampling."""

from pathlib import Path

import numpy as np
from benchmarks.awkward_files.container_files import save_mat
from benchmarks.awkward_files.instrument_files import ground_reaction
from benchmarks.awkward_files.text_tables import numbers, volts, write_table
from benchmarks.awkward_files.truth import DEG, Array, Part, Truth, Walk, part

Rng = np.random.Generator


def _points(walk: Walk) -> list[list[str]]:
    """Angle in degrees, torque, command and contact with decimal points."""
    return [
        numbers(walk.angle / DEG, 2), numbers(walk.torque, 3), numbers(walk.command, 2),
        numbers(walk.contact, 0),
    ]  # fmt: skip


def with_force(walk: Walk, force: Array, step: float, **steps: float) -> Part:
    """Return the truth of a walk that has a force plate in place of a footswitch."""
    true = part(walk, omit=("contact",), **steps)
    values = true.values | {"ground_reaction_force": force}
    return Part(values, true.step | {"ground_reaction_force": step})


def plate(walk: Walk, rng: Rng, digits: int) -> Array:
    """Return the vertical force of the right plate with its noise."""
    noise = 1.2 * rng.standard_normal(walk.time.size)
    return np.round(ground_reaction(walk) + noise, digits)


def clock_in_four_columns(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(250.0)
    milli = np.round(1e3 * (slow.clock + 11 * 3600 + 59 * 60 + 48.0)).astype(int)  # passes 12:00
    fields = (milli // 3_600_000, milli // 60_000 % 60, milli // 1000 % 60, milli % 1000)
    columns = [[str(v) for v in field] for field in fields] + _points(slow)
    names = "hour,min,sec,msec,knee_flexion_deg,torque_on_leg_Nm,torque_setpoint_Nm,heel_contact"
    write_table(path, columns, above=[names], delimiter=",")
    asked = ("@channels.time", "clock", "hour", "time&columns")
    return Truth((part(slow),), "S09", open=asked)


def wrapped_counter(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    ticks = (np.round(1e4 * slow.clock).astype(int) + 41_250) % 65_536
    above = ["% exo board rev C, subject 10, perturbed", "% tick: 16 bit timer, 0.1 ms per count"]
    above.append("tick\tknee_flex_deg\ttorque_Nm\ttorque_ref_Nm\theel")
    columns = [[str(t) for t in ticks], *_points(slow)]
    write_table(path, columns, above=above, delimiter="\t", newline="\n")
    asked = ("time&back", "time&starts again", "time&restart", "wrap", "tick", "@channels.time")
    return Truth((part(slow),), "Subj10", open=asked)


def twelve_hours(walk: Walk, path: Path, rng: Rng) -> Truth:
    force = plate(walk, rng, 1)
    start = 12 * 3600 + 59 * 60 + 43.25  # 12:59 PM is followed by 1:00 PM
    columns = [[_pm(start + t) for t in walk.clock], *_points(walk)[:3], numbers(force, 1)]
    names = "Clock,Knee Flexion [deg],Exo Torque [N-m],Commanded Torque [N-m],Right Plate Fz [N]"
    write_table(path, columns, above=["Subject 11 - perturbed", names], delimiter=",")
    asked = ("@channels.time", "clock", "am/pm", "12 hour")
    return Truth((with_force(walk, force, 0.1),), "S11", open=asked)


def _pm(seconds: float) -> str:
    milli = round(1e3 * seconds)
    hour = milli // 3_600_000
    rest = f"{milli // 60_000 % 60:02d}:{milli // 1000 % 60:02d}.{milli % 1000:03d}"
    return f"{hour - 12 if hour > 12 else hour}:{rest} PM"


def _cell(texts: list[str]) -> np.ndarray:
    cell = np.empty((1, len(texts)), dtype=object)
    cell[0, :] = texts
    return cell


def names_in_a_cell(walk: Walk, path: Path, rng: Rng) -> Truth:
    signals = (
        ("knee extension", "deg", -walk.angle / DEG), ("exo extension torque", "Nm", -walk.torque),
        ("commanded extension torque", "Nm", -walk.command),
        ("heel switch", "V", volts(walk.contact, rng)),
    )  # fmt: skip
    data = np.column_stack([np.round(values, 3) for _, _, values in signals])
    names, units = _cell([s[0] for s in signals]), _cell([s[1] for s in signals])
    save_mat(path, {"data": data, "names": names, "units": units, "fs": 500.0, "subject": "S13"})
    asked = ("columns&no names", "column&data", "@channels.angle.column", "@sample_rate_hz")
    return Truth((part(walk),), "S13", open=asked)


def visual3d(walk: Walk, path: Path, rng: Rng) -> Truth:
    slow = walk.at(200.0, 0.0, 25.0)
    force = plate(slow, rng, 3)
    signals = (
        ("TIME", "FRAME_NUMBERS", "ORIGINAL", "X", numbers(slow.clock, 6)),
        ("RIGHT_KNEE_ANGLE", "LINK_MODEL_BASED", "ORIGINAL", "X", numbers(-slow.angle / DEG, 5)),
        ("EXO_KNEE_FLEXION_TORQUE", "ANALOG", "ORIGINAL", "X", numbers(slow.torque, 5)),
        ("EXO_KNEE_FLEXION_TORQUE_CMD", "ANALOG", "ORIGINAL", "X", numbers(slow.command, 5)),
        ("FP1", "FORCE", "ORIGINAL", "Z", numbers(force, 5)),
    )  # fmt: skip
    file = "C:\\Data\\Exo\\Subject15\\Subject15_perturbed_01.c3d"
    above = ["\t".join(["", *[file] * len(signals)])]
    above += ["\t".join(["", *(str(s[i]) for s in signals)]) for i in range(3)]
    above.append("\t".join(["ITEM", *(s[3] for s in signals)]))
    columns = [[str(i + 1) for i in range(slow.time.size)]]
    columns += [s[4] for s in signals]
    write_table(path, columns, above=above, delimiter="\t")
    asked = ("@channels.angle", "@channels.torque.unit", "torque&unit", "names&columns")
    return Truth((with_force(slow, force, 0.001),), "Subject15", open=asked)


def can_integers(walk: Walk, path: Path, _rng: Rng) -> Truth:
    above = ["# candump of the exo knee, signals decoded with exo_v3.dbc"]
    above.append("ts[us],knee_flex[0.1deg],tau_leg[0.01Nm],tau_ref[0.01Nm],heel[-]")
    columns = [
        numbers(1e6 * walk.clock, 0), numbers(10 * walk.angle / DEG, 0),
        numbers(100 * walk.torque, 0), numbers(100 * walk.command, 0), numbers(walk.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter=",", newline="\n")
    asked = ("0.1deg", "0.01nm", "angle&unit", "torque&unit", "@channels.torque.unit",
             "@channels.angle.unit")  # fmt: skip
    true = part(walk, angle=0.1 * DEG, torque=0.01)
    return Truth((true,), "P19", open=asked)


def rounded_time(walk: Walk, path: Path, rng: Rng) -> Truth:
    fast = walk.at(1000.0, 0.0, 25.0)
    hundredths = np.floor(100 * fast.clock + 1e-6) / 100
    above = ["Subject:\tS25", "Condition:\tperturbed", "Sampling frequency:\t1000 Hz", ""]
    above.append("Time (s)\tKnee flexion (deg)\tExo torque (Nm)\tTorque command (Nm)\tHeel FSR (V)")
    columns = [
        numbers(hundredths, 2), *_points(fast)[:3], numbers(volts(fast.contact, rng), 3),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter="\t")
    asked = ("time&repeat", "time&increase", "@channels.time", "@sample_rate_hz", "rounded")
    return Truth((part(fast),), "S25", open=asked)


def lost_packets(walk: Walk, path: Path, rng: Rng) -> Truth:
    slow = walk.at(200.0)
    starts = np.flatnonzero(rng.random(slow.time.size) < 0.006)
    lost = np.zeros(slow.time.size, dtype=bool)
    for start in starts[starts > 100]:
        lost[start : start + int(rng.integers(1, 7))] = True
    kept = slow.rows(~lost)
    counter = (np.flatnonzero(~lost) + 77) % 256
    above = ["# radio log, subject 27, perturbed walking", "# 200 packets per second"]
    above.append("# packets that were lost have no row; packet counts 0 to 255")
    above.append("packet;knee_flexion_deg;leg_torque_Nm;torque_setpoint_Nm;heel_0_1")
    write_table(path, [[str(c) for c in counter], *_points(kept)], above=above, newline="\n")
    asked = ("packet", "lost", "counter", "missing rows", "wrap")
    return Truth((part(kept),), "S27", open=asked)
