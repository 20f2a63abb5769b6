"""The cases: what is drawn for each, what is planted, and the files that the program is given."""

import json
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.planted_errors.physics import (
    CLIP,
    POINTS,
    Recording,
    Truth,
    bench,
    held_joint,
    walk,
)
from benchmarks.planted_errors.strapped import WINDOW_S, drawn_strapped, walk_strapped

Params = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """A world with one mistake, or none."""

    family: str  # walking, strapped, bench or joint
    fault: str  # "" where nothing is wrong
    tag: str = ""
    settings: Params = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name on the command line and in the tables."""
        return "_".join(part for part in (self.family, self.fault or "clean", self.tag) if part)


_SIZES = {"sizes": (0.4, 0.7, 1.0)}  # what was clipped shows where small pulses were not
_MANY = _SIZES | {"pulses": 24}
_EXACT = {"pulses": 40, "k": 60.0, "b": 2.3, "j": 0.05, "amplitude": 6.0, "hold_s": 0.25}
_EXACT |= {"every_s": 1.5, "jitter_s": 0.0, "motor_s": 0.006, "rate": 500, "angle_noise": 5e-5}
_EXACT |= {"torque_noise": 0.05, "muscle_nm": 0.0, "angle_lag_s": 0.0, "sizes": (1.0,)}
_EXACT |= {"signs": (1,), "body": False, "lag_known": False, "clock": True}


_WALKING = ("sign_torque", "clip_applied", "clip_sensor", "held_25hz", "late", "drift")
_WALKING += ("rate_300", "labels", "mass_tenth", "mass_lb", "height_cm", "gain_10")
_WALKING += ("other_record", "filled")
#: A strapped leg is tried with what the benches are, too.
_STRAPPED = (*_WALKING, "sign_angle", "degrees", "n_mm", "exchanged", "rate_half", "rate_double")
_STRAPPED += ("hum", "quantised")


def planted() -> list[Case]:
    """Those with a mistake."""
    own: dict[str, Params] = {
        "clip_applied": _MANY | {"points": ["PSW", "MSW"]},
        "clip_sensor": _MANY | {"points": ["ISW", "TST"]},
        "rate_300": {"rate": 250, "clock": False, "table": True},
        "labels": {"table": True, "points": ["LRE", "TST", "ISW"], "pulses": 14},
        "late": {"people": 2},
    }
    cases = [Case("walking", f, settings=own.get(f, {})) for f in _WALKING]
    own = {"rate_300": {"clock": False}}
    own |= {"rate_half": {"clock": False}, "rate_double": {"clock": False}}
    cases += [Case("strapped", f, settings=own.get(f, {})) for f in _STRAPPED]
    on_bench = ["sign_angle", "degrees", "n_mm", "clip_applied", "clip_sensor", "held_25hz"]
    on_bench += ["late", "drift", "rate_half", "rate_double", "exchanged", "gain_10", "filled"]
    own = {
        "clip_applied": _SIZES | {"pulses": 36},
        "clip_sensor": _SIZES | {"pulses": 30},
        "rate_half": {"clock": False, "table": True},
        "rate_double": {"clock": False, "table": False, "body": True},
    }
    cases += [Case("bench", f, settings=own.get(f, {})) for f in [*on_bench, "hum"]]
    held = ["sign_torque", "degrees", "n_mm", "clip_applied", "held_25hz", "late", "drift"]
    held += ["exchanged", "gain_10", "other_record", "filled", "quantised"]
    own = {
        "clip_applied": {"with_command": True},
        "gain_10": {"with_command": True},
        "sign_torque": {"input": "angle"},
        "filled": {"input": "angle"},
    }
    return cases + [Case("joint", f, settings=own.get(f, {})) for f in held]


def clean() -> list[Case]:
    """Those without."""
    walking: list[Params] = [
        {},
        {"pulses": 40, "points": ["LRE", "ISW"]},
        {"people": 2},
        _MANY | {"points": ["PSW", "MSW"], "table": True},
        {"pulses": 8, "points": ["LRE", "TST", "PSW", "MSW"]},
        {"signs": (1, -1), "pulses": 20, "points": ["TST", "ISW"]},
        {"clock": False, "table": True},
    ]
    on_bench: list[Params] = [_EXACT, {}, {"body": True}, _SIZES, {"pulses": 8}]
    on_bench += [{"clock": False, "table": True}, {"signs": (1,), "body": True}]
    held: list[Params] = [{}, {"with_command": True}, {"input": "angle"}, {}]
    held += [{"with_command": True}, {"input": "angle"}]
    strapped: list[Params] = [{}, {"table": False, "seed": 2}, {"clock": False, "seed": 3}]
    families = {"walking": walking, "strapped": strapped, "bench": on_bench, "joint": held}
    return [
        Case(family, "", str(number), settings)
        for family, rows in families.items()
        for number, settings in enumerate(rows, start=1)
    ]


def _drawn(rng: np.random.Generator, case: Case) -> Params:
    """Draw one person or load; the case's own settings stand over what is drawn."""
    if case.family == "strapped":
        return drawn_strapped(case.settings.get("seed", 1)) | {"fault": case.fault} | case.settings
    mass, height = rng.uniform(50, 95), rng.uniform(1.55, 1.95)
    # Winter (2009): shank and foot about the knee; the hip gives way, so that less is felt.
    leg = 0.061 * mass * (0.735 * 0.246 * height) ** 2 * rng.uniform(0.6, 0.75)
    p: Params = {"fault": case.fault, "mass": mass, "height": height, "motor_s": 0.006}
    p |= {"torque_noise": rng.uniform(0.03, 0.1), "signs": (1,), "sizes": (1.0,), "clock": True}
    p |= {"rate": int(rng.choice([250, 500, 1000])), "table": bool(rng.integers(2)), "people": 1}
    p |= {"lag_known": bool(rng.random() < 0.6)}
    if case.family == "walking":
        k = rng.uniform(40, 150)
        b = rng.uniform(0.3, 1.0) * (k * leg) ** 0.5  # 0.15 to 0.5 of critical damping
        p |= {"k": k, "j": leg, "b": float(np.clip(b, 0.7, 4.5))}
        p |= {"sway": rng.uniform(0.2, 1.0)}  # some walk so evenly that K and B are decided
        count = int(rng.integers(2, 5))
        p |= {"points": sorted(rng.choice(list(POINTS), count, replace=False).tolist())}
        p |= {"pulses": int(rng.integers(8, 21)), "stride_s": rng.uniform(1.0, 1.25)}
        p |= {"stiffest": rng.uniform(0, 1), "amplitude": rng.uniform(9, 17), "hold_s": 0.25}
        p |= {"angle_noise": 5e-4, "angle_lag_s": rng.integers(9) / 2000, "body": True}
        return p | case.settings
    p |= {"k": rng.uniform(20, 150), "b": rng.uniform(0.5, 4), "posture": rng.uniform(0.1, 0.6)}
    p |= {"j": rng.uniform(0.03, 0.3), "angle_lag_s": 0.0, "angle_noise": 5e-5, "jitter_s": 0.3}
    p |= {"body": False, "pulses": int(rng.integers(10, 41)), "every_s": 1.8, "hold_s": 0.25}
    p |= {"amplitude": rng.uniform(4, 10), "signs": (1, -1), "seconds": rng.uniform(60, 120)}
    p |= {"muscle_nm": 0.1, "input": "torque", "with_command": False}
    p |= {"band_hz": rng.uniform(4, 8)}
    if case.settings.get("body"):  # a relaxed knee
        p |= {"j": leg}
    return p | case.settings


def _late(values: np.ndarray, samples: int) -> np.ndarray:
    return np.concatenate([np.full(samples, values[0]), values[:-samples]])


def _filled(rec: Recording, rng: np.random.Generator) -> None:
    """The sensor drops out for 50 to 300 ms now and then; the logger repeats the last value."""
    left = 0.05 * rec.angle.size
    while left > 0:
        length = int(rng.uniform(0.05, 0.3) * rec.rate)
        first = int(rng.integers(1, rec.angle.size - length))
        rec.angle[first : first + length] = rec.angle[first - 1]
        left -= length


def _drift(rec: Recording) -> None:
    """The torque's own clock is 2 % fast, and its samples were put beside the others."""
    at = np.arange(rec.torque.size)
    rec.torque = np.interp(at * 1.02, at, rec.torque)


def _hum(rec: Recording) -> None:
    at = np.arange(rec.torque.size) / rec.rate
    rec.torque = rec.torque + 1.5 * np.sin(2 * np.pi * 50 * at)
    rec.angle = rec.angle + 0.005 * np.sin(2 * np.pi * 50 * at + 1.0)


def _held(rec: Recording) -> None:
    at = np.arange(rec.torque.size)
    rec.torque = rec.torque[at - at % (rec.rate // 25)]


def plant(rec: Recording, p: Params, rng: np.random.Generator) -> None:
    """Put the case's mistake into a recording; those of the study file are made elsewhere."""
    limit = CLIP * p["amplitude"]
    deeds: dict[str, Callable[[], Any]] = {
        "sign_torque": lambda: np.negative(rec.torque, out=rec.torque),
        "sign_angle": lambda: np.negative(rec.angle, out=rec.angle),
        "degrees": lambda: np.degrees(rec.angle, out=rec.angle),
        "n_mm": lambda: np.multiply(rec.torque, 1000.0, out=rec.torque),
        "gain_10": lambda: np.multiply(rec.torque, 10.0, out=rec.torque),
        "clip_sensor": lambda: np.clip(rec.torque, -limit, limit, out=rec.torque),
        "held_25hz": lambda: _held(rec),
        "late": lambda: setattr(rec, "torque", _late(rec.torque, round(0.02 * rec.rate))),
        "drift": lambda: _drift(rec),
        "exchanged": lambda: rec.__dict__.update(angle=rec.torque, torque=rec.angle),
        "filled": lambda: _filled(rec, rng),
        "quantised": lambda: setattr(
            rec, "angle", np.radians(0.5) * np.round(rec.angle / np.radians(0.5))
        ),
        "hum": lambda: _hum(rec),
    }
    deeds.get(p["fault"], lambda: None)()


def _other_torque(rec: Recording, other: Recording) -> None:
    """Torque of another trial of the same protocol, cut or repeated to this one's length."""
    rec.torque = np.resize(other.torque, rec.torque.size)


def _write(rec: Recording, path: Path, p: Params) -> None:
    columns = {"time": np.arange(rec.angle.size) / rec.rate} if p["clock"] else {}
    columns |= {"angle": rec.angle, "torque": rec.torque, "command": rec.command}
    if rec.contact is not None:
        columns["contact"] = rec.contact
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.8g")
    if p["table"] and rec.pulses:
        table = pd.DataFrame(rec.pulses)
        if p["fault"] == "labels":
            table["timing_point"] = np.roll(table["timing_point"], 1)
        table.to_csv(path.with_suffix(".pulses.csv"), index=False)


def _head(family: str, p: Params) -> list[str]:
    """Head of a study file."""
    wrong = {"rate_300": 300, "rate_half": p["rate"] / 2, "rate_double": p["rate"] * 2}
    kind = "walking" if family == "strapped" else family
    lines = ["jointz = 1", 'joint = "knee"', f'kind = "{kind}"', 'positive = "flexion"']
    lines += ['coupling = "rigid"'] if family == "walking" else []
    lines += ['subjects = "people"'] if family == "bench" and p["body"] else []
    lines += [] if p["clock"] else [f"sample_rate_hz = {float(wrong.get(p['fault'], p['rate']))}"]
    units = {"time": "s"} if p["clock"] else {}
    units |= {"angle": "rad", "torque": "N*m", "command": "N*m"}
    lines += [f'channels.{c} = {{ column = "{c}", unit = "{u}" }}' for c, u in units.items()]
    if kind == "walking":
        lines += ['channels.contact = { column = "contact", kind = "contact" }', "[perturbations]"]
        points = ", ".join(f"{name} = {POINTS[name]}" for name in p["points"])
        lines += [f"timing_points = {{ {points} }}"]
        lines += [f"window_s = {WINDOW_S}"] if family == "strapped" else []
    if p["lag_known"]:
        lags = {"angle_lag_s": p["angle_lag_s"], "torque_lag_s": 0.0}
        lines += ["[calibration]"]
        lines += [f"{key} = {{ value = {lag:.4f}, sd = 0.0003 }}" for key, lag in lags.items()]
    return lines


def _person(name: str, p: Params) -> list[str]:
    """One participant, with the body as the lab wrote it down."""
    lines = ["[[participants]]", f'id = "{name}"']
    if not p["body"]:
        return lines
    factor = {"mass_tenth": 0.1, "mass_lb": 2.2046}.get(p["fault"], 1.0)
    height = p["height"] * (100.0 if p["fault"] == "height_cm" else 1.0)
    return [*lines, f"mass_kg = {p['mass'] * factor:.1f}", f"height_m = {height:.2f}"]


def _entry(name: str, condition: str, file: str, p: Params) -> list[str]:
    lines = ["[[recordings]]", f'participant = "{name}"', f'condition = "{condition}"']
    lines += [f'file = "{file}"']
    if p["table"] and condition == "perturbed":
        lines += [f'perturbations = "{Path(file).with_suffix(".pulses.csv")}"']
    return lines


def _recordings(
    case: Case, rng: np.random.Generator, p: Params
) -> tuple[dict[str, Recording], Truth]:
    """What one person's or load's files hold, mistake included."""

    def recorded(condition: str) -> tuple[Recording, Truth]:
        perturbed = condition != "unperturbed"
        if case.family == "strapped":
            return walk_strapped(p, condition, perturbed=perturbed)
        return walk(rng, p, perturbed=perturbed) if case.family == "walking" else bench(rng, p)

    rec, truth = recorded("perturbed")
    if p["fault"] == "other_record":
        _other_torque(rec, recorded("another trial")[0])
    found = {"perturbed": rec}
    if case.family in ("walking", "strapped"):
        found["unperturbed"] = recorded("unperturbed")[0]
    for each in found.values():
        plant(each, p, rng)
    return found, truth


def write_case(case: Case, folder: Path) -> list[str]:
    """Write a case's files and ``truth.json``; return the command's arguments."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(zlib.crc32(case.name.encode()))
    p = _drawn(rng, case)
    if case.family == "joint":
        return _write_joint(rng, p, folder)
    head, people, files, truths = _head(case.family, p), [], [], {}
    for number in range(p["people"]):
        name = f"S{number + 1:02d}"
        if number:  # another body at the same timing points
            p = _drawn(rng, case) | {key: p[key] for key in ("points", "rate", "table", "clock")}
        found, truths[name] = _recordings(case, rng, p)
        people += _person(name, p)
        for condition, rec in found.items():
            _write(rec, folder / f"{name}_{condition}.csv", p)
            files += _entry(name, condition, f"{name}_{condition}.csv", p)
    (folder / "study.toml").write_text("\n".join([*head, *people, *files]) + "\n")
    (folder / "truth.json").write_text(json.dumps(truths, indent=1))
    results = str(folder.parent / f"{folder.name}-results")
    arguments = ["analyze", str(folder), "--out", results, "--resamples", "50", "--workers", "1"]
    return [*arguments, "--overwrite", "--quiet"]


def _write_joint(rng: np.random.Generator, p: Params, folder: Path) -> list[str]:
    """One record of a held joint, for ``identify joint``."""
    rec, truth = held_joint(rng, p)
    if p["fault"] == "other_record":
        _other_torque(rec, held_joint(rng, p)[0])
    plant(rec, p, rng)
    turned = p["input"] == "angle"  # a load cell between servo and joint: torque on the device
    rec.torque = -rec.torque if turned else rec.torque
    _write(rec, folder / "record.csv", p | {"table": False})
    (folder / "truth.json").write_text(json.dumps({"": truth}, indent=1))
    columns = ["--angle", "angle:rad", "--torque", "torque:N*m", "--time", "time:s"]
    columns += ["--command", "command:N*m"] if p["with_command"] else []
    columns += ["--input", "angle", "--torque-acts-on", "device"] if turned else []
    return ["identify", "joint", str(folder / "record.csv"), *columns, "--json"]
