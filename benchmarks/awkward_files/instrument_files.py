"""Files in the style of acquisition and motion-capture programs."""

from pathlib import Path

import numpy as np
from benchmarks.awkward_files.text_tables import numbers, volts, write_table
from benchmarks.awkward_files.truth import DEG, Array, Part, Truth, Walk, part

Rng = np.random.Generator
HALF_STRIDE_S = 0.55
WEIGHT_N = 716.0


def other_leg(walk: Walk, values: Array) -> Array:
    """Return a signal of the other leg, half a stride later."""
    return np.interp(walk.time - HALF_STRIDE_S, walk.time, values)


def _points(walk: Walk) -> list[list[str]]:
    """Time, angle in degrees, torque, command and contact with decimal points."""
    return [
        numbers(walk.clock, 3), numbers(walk.angle / DEG, 2), numbers(walk.torque, 3),
        numbers(walk.command, 2), numbers(walk.contact, 0),
    ]  # fmt: skip


def two_legs(walk: Walk, path: Path, _rng: Rng) -> Truth:
    left = [numbers(other_leg(walk, walk.angle) / DEG, 2)]
    left.append(numbers((other_leg(walk, walk.contact) > 0.5).astype(float), 0))
    above = [
        "Software,MR 3.18.68", "Report,Export to CSV", "Project,ExoKnee", "Subject,10",
        "Record Name,perturbed walking", "Record Date,2023-11-08", "Record Time,10:14:52",
        "Record Length,40.0 s", "Operator,lab", "Belt speed,1.2 m/s", "Device,DTS receiver 16ch",
        "Frequency,500 Hz", "Filter,none", "Goniometer,SG150", "Exoskeleton side,right",
        "Number of signals,6", "Missing samples,0", "Comment,", "Markers,none", "",
        ",Right,Right,Right,Right,Left,Left",
        "Time (s),Knee Flexion (deg),Torque (Nm),Torque Ref (Nm),Foot Contact,"
        "Knee Flexion (deg),Foot Contact",
    ]  # fmt: skip
    write_table(path, [*_points(walk), *left], above=above, delimiter=",")
    asked = ("two legs", "both legs", "angle&left", "duplicate", "same name", "twice")
    return Truth((part(walk),), "P10", open=asked)


def ground_reaction(walk: Walk) -> Array:
    """Return a vertical force with two humps in each stance."""
    force = np.zeros(walk.time.size)
    edges = np.flatnonzero(np.diff(np.r_[0.0, walk.contact, 0.0]))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        phase = (np.arange(end - first) + 0.5) / (end - first)
        force[first:end] = 1.25 * np.sin(np.pi * phase) + 0.45 * np.sin(3 * np.pi * phase)
    return WEIGHT_N * force


def motion_capture(walk: Walk, path: Path, rng: Rng) -> Truth:
    fast = walk.at(1000.0, 0.0, 25.0)
    n = fast.time.size
    right = np.round(ground_reaction(fast) + 1.5 * rng.standard_normal(n), 2)
    left = other_leg(fast, ground_reaction(fast)) + 1.5 * rng.standard_normal(n)
    shear = [numbers(10.0 * rng.standard_normal(n), 2) for _ in range(4)]
    above = [
        "Devices", "1000",
        ",,FP1 right - Force,,,FP2 left - Force,,,Exo right - Knee,Exo right - Torque,"
        "Exo right - Torque command",
        "Frame,Sub Frame,Fx,Fy,Fz,Fx,Fy,Fz,Flexion,Torque,Command",
        ",,N,N,N,N,N,N,deg,N.mm,N.mm",
    ]  # fmt: skip
    columns = [
        [str(1 + i // 10) for i in range(n)], [str(i % 10) for i in range(n)],
        *shear[:2], numbers(right, 2), *shear[2:], numbers(left, 2),
        numbers(fast.angle / DEG, 3), numbers(1e3 * fast.torque, 0), numbers(1e3 * fast.command, 0),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter=",")
    true = part(fast, omit=("contact",))
    values = true.values | {"ground_reaction_force": right}
    asked = ("sample_rate", "sampling rate", "two plates", "force&two", "plate")
    return Truth(
        (Part(values, true.step | {"ground_reaction_force": 0.01}),), "", "perturbed", open=asked
    )


def interval_above(walk: Walk, path: Path, rng: Rng) -> Truth:
    n = f"{walk.time.size}\t"
    above = [
        "subj12_pert.acq", "2 msec/sample", "4 channels", "Goniometer knee flexion", "deg",
        "Torque", "Nm", "Torque command", "Nm", "Heel switch", "Volts",
        "CH1\tCH2\tCH3\tCH40\t", n * 4,
    ]  # fmt: skip
    columns = [*_points(walk)[1:4], numbers(volts(walk.contact, rng), 3)]
    write_table(path, columns, above=above, delimiter="\t", end="\t")
    asked = ("@sample_rate_hz", "@channels.torque", "msec/sample", "ch1", "columns&no names")
    return Truth((part(walk),), "subj12", open=asked)


def labview_gap(walk: Walk, path: Path, rng: Rng) -> Truth:
    kept = walk.rows((walk.clock < 17.3) | (walk.clock >= 19.1))
    four = "\t".join(["{}"] * 4)
    above = [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        "Decimal_Separator\t.", "Multi_Headings\tNo", "X_Columns\tOne", "Time_Pref\tAbsolute",
        "Operator\tlab", "Date\t2024/03/12", "Time\t10:21:33.4512", "***End_of_Header***\t", "\t",
        "Channels\t4\t\t\t\t", f"Samples\t{four.format(*[kept.time.size] * 4)}\t",
        f"Date\t{four.format(*['2024/03/12'] * 4)}\t",
        f"Time\t{four.format(*['10:21:33.4512'] * 4)}\t",
        "Y_Unit_Label\tdeg\tN*m\tN*m\tV\t", f"X_Dimension\t{four.format(*['Time'] * 4)}\t",
        f"X0\t{four.format(*['0.0'] * 4)}\t", f"Delta_X\t{four.format(*['0.002'] * 4)}\t",
        "***End_of_Header***\t\t\t\t\t",
        "X_Value\tKnee flexion\tTorque\tTorque setpoint\tHeel switch\tComment",
    ]  # fmt: skip
    columns = [
        numbers(kept.clock, 6), *_points(kept)[1:4], numbers(volts(kept.contact, rng), 3),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter="\t", end="\t")
    return Truth(
        (part(kept),), "P13", open=("gap", "@channels.angle.unit", "@channels.torque.unit")
    )


def torque_on_device(walk: Walk, path: Path, rng: Rng) -> Truth:
    speed = np.gradient(walk.angle, walk.time) * 9.0 / (2 * np.pi) * 60.0
    names = ["Zeit 1 - Standardmessrate", "Kniewinkel Beugung", "Reaktionsmoment auf Gerät"]
    names += ["Sollmoment", "Motordrehzahl", "Fersenschalter"]
    above = [
        "HBM_CATMAN_DATAFILE_40", "1252", "Prüfstand: Exo Knie rechts", "KANÄLE=6",
        f"WERTE={walk.time.size}", "T0=27.11.2023 09:41:12", "MESSRATE=500 Hz",
        "Kommentar=Proband VP14, Störversuch 17 Nm",
        "Kommentar=Messflansch misst das Moment des Beins auf das Gerät", "", "\t".join(names),
        "\t".join(["s", "Grad", "Nm", "Nm", "1/min", "V"]),
    ]  # fmt: skip
    columns = [
        numbers(walk.clock, 3, ","), numbers(walk.angle / DEG, 2, ","),
        numbers(-walk.torque, 3, ","), numbers(walk.command, 2, ","), numbers(speed, 0, ","),
        numbers(volts(walk.contact, rng), 3, ","),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter="\t", encoding="cp1252")
    return Truth((part(walk),), "VP14", open=("@torque_acts_on", "torque_acts_on", "on the device"))


def robot_log(walk: Walk, path: Path, rng: Rng) -> Truth:
    begin = 1_714_728_123_456_789_012
    stamp = [begin + round(t * 1e9) for t in walk.clock]
    delay = np.abs(4e5 * rng.standard_normal(walk.time.size)).astype(int)
    arrival = [s + int(d) for s, d in zip(stamp, delay, strict=True)]
    fields = ["seq", "stamp", "frame_id"]
    names = ["%time", *(f"field.header.{f}" for f in fields)]
    names += [f"field.{f}" for f in ("knee_angle", "joint_torque", "torque_cmd", "heel_contact")]
    columns = [
        [str(a) for a in arrival], [str(i) for i in range(walk.time.size)], [str(s) for s in stamp],
        ["exo"] * walk.time.size, numbers(walk.angle, 6), numbers(walk.torque, 4),
        numbers(walk.command, 2), numbers(walk.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=[",".join(names)], delimiter=",", newline="\n")
    true = part(walk, time=1e-6, angle=1e-6, torque=1e-4)
    arrived = np.array([a - begin for a in arrival], dtype=float) * 1e-9
    by_arrival = Part(true.values | {"time": arrived}, true.step)
    asked = ("@channels.time", "nanosecond", "clock", "time&unit")
    return Truth((true, by_arrival), "15", open=asked)


def microcontroller(walk: Walk, path: Path, rng: Rng) -> Truth:
    regular = walk.at(200.0).clock
    jitter = 3e-4 * rng.standard_normal(regular.size)
    micros = np.round(1e6 * (regular + 0.002 + np.clip(jitter, -1e-3, 1e-3)))
    times = walk.time[0] + micros * 1e-6
    held = np.clip(np.searchsorted(walk.time, times, side="right") - 1, 0, None)
    log = Walk(
        times, np.interp(times, walk.time, walk.angle), np.interp(times, walk.time, walk.torque),
        walk.command[held], walk.contact[held],
    )  # fmt: skip
    above = ["# exo logger 1.4.2", "# subject 16, perturbed", "# 200 Hz, SD card"]
    above.append("micros,knee_deg,torque_mNm,torque_cmd_mNm,fsr_heel_mV")
    columns = [
        numbers(micros + 7_310_204, 0), numbers(log.angle / DEG, 2), numbers(1e3 * log.torque, 0),
        numbers(1e3 * log.command, 0), numbers(1e3 * volts(log.contact, rng), 0),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter=",")
    return Truth((part(log, time=1e-6),), "S16", open=("@channels.time", "micro", "jitter"))


def repeated_angle(walk: Walk, path: Path, rng: Rng) -> Truth:
    fast = walk.at(10_000.0, 6.0, 8.0)
    samples = np.arange(fast.time.size)
    angle = fast.angle[100 * (samples // 100)]
    names = "Time (s),Knee flexion (deg),Torque (Nm),Torque command (Nm),Heel FSR (V)"
    columns = [
        numbers(fast.clock, 4), numbers(angle / DEG, 2), numbers(fast.torque, 3),
        numbers(fast.command, 2), numbers(volts(fast.contact, rng), 3),
    ]  # fmt: skip
    write_table(path, columns, above=[names], delimiter=",")
    true = part(fast)
    fresh = np.where(samples % 100 == 0, fast.angle, np.nan)
    asked = ("angle&repeat", "angle&slow", "angle&rate")
    return Truth((Part(true.values | {"angle": fresh}, true.step),), "S20", open=asked)


def torque_in_counts(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(250.0)
    counts = np.round(2061.0 + 41.7 * slow.torque)
    columns = [
        numbers(slow.clock * 1e3, 0), numbers(slow.angle / DEG, 2), numbers(counts, 0),
        numbers(slow.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=["time_ms,knee_flex_deg,loadcell_raw,heel"], delimiter=",")
    asked = ("torque&count", "torque&raw", "torque&scale", "torque&unit", "loadcell_raw")
    true = part(slow, omit=("torque", "command"))
    return Truth((true,), "S27", open=asked, answerable=False, hopeless=True)
