"""The main job with nothing to bring: simulate a study, analyse it, show the truth."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from jointz.core.analysis import StudyAnalysis
from jointz.core.recording import build_recording
from jointz.io.netcdf import write_recording
from jointz.sim.walker import Participant, Simulated, WalkerSettings, draw_participants
from jointz.sim.walker import simulate_recording as simulate
from jointz.workflows.analysis import Progress, analyze
from jointz.workflows.results_folder import new_folder, write_marker, write_results

MARKER = ".jointz-demo"
_CONDITIONS: tuple[Literal["unperturbed", "perturbed"], ...] = ("unperturbed", "perturbed")
_CHANNELS = ("angle", "torque", "command", "contact")

#: Lag of the measured angle of the nominal rig.
_ANGLE_LAG_S = (0.004, 0.012)


@dataclass(frozen=True, slots=True)
class Demo:
    """What the demo made.

    Parameters
    ----------
    report : pathlib.Path
        The page to open.
    analysis : StudyAnalysis
        The analysis of the simulated study.
    truth : pandas.DataFrame
        Truth against estimate, one row a participant, timing point and parameter.
    """

    report: Path
    analysis: StudyAnalysis
    truth: pd.DataFrame

    def accuracy(self) -> pd.DataFrame:
        """Return RMS error (%) and coverage of the intervals by parameter."""
        return pd.DataFrame(
            [
                {
                    "parameter": name,
                    "rms_error_pct": float(np.sqrt((rows["error_pct"] ** 2).mean())),
                    "coverage": float(rows["covered"].mean()),
                    "n": len(rows),
                }
                for name, rows in self.truth.groupby("parameter", sort=False)
            ]
        )


def run_demo(
    out: Path, *, quick: bool = False, seed: int = 1, progress: Progress | None = None
) -> Demo:
    """Simulate a walking study, analyse it and write the report beside the truth.

    Parameters
    ----------
    out : pathlib.Path
        The demo's folder; replaced only where an earlier demo made it.
    quick : bool
        Two participants with 10 pulses a timing point instead of ten with 50.
    seed : int
        Of participants and simulation.
    progress : callable, optional
        Called with (done, of how many, what comes next).

    Returns
    -------
    Demo
        The analysis and the truth.

    Raises
    ------
    OutputError
        When the folder exists and no demo made it.
    """
    n_participants, n_pulses = (2, 10) if quick else (10, 50)
    with new_folder(out, marker=MARKER, overwrite=True) as folder:
        people = write_study(
            folder / "study",
            n_participants=n_participants,
            n_pulses_per_point=n_pulses,
            seed=seed,
            progress=progress,
        )
        analysis = analyze(folder / "study", seed=seed, progress=progress)
        truth = truth_table(analysis, people)
        truth.to_csv(folder / "truth.csv", index=False, float_format="%.10g")
        write_results(analysis, folder / "results", truth=truth)
        write_marker(folder, MARKER, {"made_by": "jointz demo"})
    return Demo(out / "results" / "report.html", analysis, truth)


def write_study(
    folder: Path,
    *,
    n_participants: int,
    n_pulses_per_point: int,
    seed: int,
    n_unperturbed_strides: int = 60,
    settings: WalkerSettings | None = None,
    suffix: str = ".nc",
    progress: Progress | None = None,
) -> tuple[Participant, ...]:
    """Simulate a walking study and write it as a study folder.

    Parameters
    ----------
    folder : pathlib.Path
        Made; holds ``study.toml`` and the recordings. ``ground_truth.json`` is
        written beside it and never read by the analysis.
    n_participants, n_pulses_per_point, n_unperturbed_strides : int
        Size of the study.
    seed : int
        Of participants and simulation; each participant has a stream of its own.
    settings : WalkerSettings, optional
        Of the simulation; by default the nominal ones, with a lag of the
        angle of 4 to 12 ms drawn for each participant.
    suffix : str
        ``.nc`` or ``.csv``.
    progress : callable, optional
        Called with (done, of how many, what comes next).

    Returns
    -------
    tuple of Participant
        The people, with their true impedance.
    """
    folder.mkdir(parents=True)
    write = _write_csv if suffix == ".csv" else _write_netcdf
    people = draw_participants(n_participants, np.random.default_rng(seed))
    instruments = [
        settings or _nominal(np.random.default_rng([seed, k])) for k in range(len(people))
    ]
    for k, person in enumerate(people):
        if progress:
            progress(k, len(people), f"simulating {person.id}")
        for j, condition in enumerate(_CONDITIONS):
            simulated = simulate(
                person,
                condition=condition,
                rng=np.random.default_rng([seed, k, j]),
                settings=instruments[k],
                n_strides=n_unperturbed_strides,
                n_pulses_per_point=n_pulses_per_point,
            )
            write(simulated, person, condition, folder / f"{person.id}_{condition}{suffix}")
    (folder / "study.toml").write_text(_study_toml(people, suffix), encoding="utf-8")
    truth = [
        {**asdict(person), "angle_lag_s": own.angle_lag_s}
        for person, own in zip(people, instruments, strict=True)
    ]
    text = json.dumps(truth, indent=2, default=dict)
    folder.with_name("ground_truth.json").write_text(text + "\n", encoding="utf-8")
    return people


def _nominal(rng: np.random.Generator) -> WalkerSettings:
    """Draw a goniometer's lag: nobody's instruments are without one (SCIENCE 4, nominal)."""
    return WalkerSettings(angle_lag_s=float(rng.uniform(*_ANGLE_LAG_S)))


def truth_table(analysis: StudyAnalysis, people: tuple[Participant, ...]) -> pd.DataFrame:
    """Set every estimate beside the truth it should have found.

    Parameters
    ----------
    analysis : StudyAnalysis
        Of the simulated study.
    people : tuple of Participant
        Its people.

    Returns
    -------
    pandas.DataFrame
        ``participant, timing_point, parameter, truth, estimate, ci_low, ci_high,
        error_pct, covered``; estimates that do not stand are left out.
    """
    by_id = {person.id: person for person in people}
    rows = []
    for cell in analysis.cells:
        person, point = by_id[cell.participant], cell.timing_point
        true_values = {
            "stiffness": person.stiffness_per_mass[point] * person.mass_kg,
            "damping": person.damping_per_mass[point] * person.mass_kg,
            "inertia": person.inertia,
        }
        for name, true_value in true_values.items():
            estimate = cell.parameter(name)
            if estimate is None or estimate.value is None or not estimate.stands:
                continue
            low, high = estimate.ci_low or 0.0, estimate.ci_high or 0.0
            rows.append(
                {
                    "participant": cell.participant,
                    "timing_point": point,
                    "parameter": name,
                    "truth": true_value,
                    "estimate": estimate.value,
                    "ci_low": low,
                    "ci_high": high,
                    "error_pct": 100.0 * (estimate.value / true_value - 1.0),
                    "covered": low <= true_value <= high,
                }
            )
    return pd.DataFrame(rows)


def _write_netcdf(simulated: Simulated, person: Participant, condition: str, path: Path) -> None:
    recording = build_recording(
        simulated.time,
        {name: getattr(simulated, name) for name in _CHANNELS},
        units={"contact": "1"},
        participant=person.id,
        condition=condition,
        file=path.name,
        joint="knee",
        positive="flexion",
        contact_kind="contact",
        history=({"step": "simulated", "by": "jointz.sim.walker"},),
    )
    write_recording(recording, path)


def _write_csv(simulated: Simulated, person: Participant, condition: str, path: Path) -> None:
    """Write what a lab's logger writes: plain numbers, no more digits than it has."""
    del person, condition
    table = pd.DataFrame({"time": simulated.time, **{n: getattr(simulated, n) for n in _CHANNELS}})
    table.round(6).to_csv(path, index=False)


def _study_toml(people: tuple[Participant, ...], suffix: str) -> str:
    channels = {"time": "s", "angle": "rad", "torque": "N*m", "command": "N*m"}
    lines = [
        "jointz = 1",
        'joint = "knee"',
        'kind = "walking"',
        'positive = "flexion"',
        'torque_acts_on = "joint"',
    ]
    for name, unit in channels.items():
        lines += ["", f"[channels.{name}]", f'column = "{name}"', f'unit = "{unit}"']
    lines += ["", "[channels.contact]", 'column = "contact"', 'kind = "contact"']
    for p in people:
        lines += ["", "[[participants]]", f'id = "{p.id}"', f"mass_kg = {p.mass_kg:.2f}"]
        lines += [f"height_m = {p.height_m:.3f}"]
    for p in people:
        for condition in _CONDITIONS:
            lines += ["", "[[recordings]]", f'participant = "{p.id}"']
            lines += [f'condition = "{condition}"', f'file = "{p.id}_{condition}{suffix}"']
    return "\n".join(lines) + "\n"
