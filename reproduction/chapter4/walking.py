"""Chapter IV's experiment on simulated people: run, analysed by both methods, truth beside."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from jointz.analysis.analyze import DEFAULT_RESAMPLES, analyze
from jointz.core.events import StrideRecord
from jointz.core.protocols.protocol import Protocol
from jointz.core.study import Study
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.statistics.waveform_test import WaveformTest
from jointz.results.study_analysis import StudyAnalysis
from jointz.rig.session.run import run
from jointz.stats.sign_flip import sign_flip_max_t
from jointz.stats.spm import spm_paired_t
from jointz.tasks.open_engine import open_engine
from jointz.tasks.progress import Progress, RunProgress
from reproduction import printed_numbers
from reproduction.chapter_runs import study_truth
from reproduction.printed_numbers import PARAMETER_NAMES

#: Nodes of a cycle, 0 and 100 % included: as spm1d's users have them.
NODES = 101
#: Of position and torque (4.2.2).
CUTOFF_HZ = 20.0
#: Differences of a joint's angle below this are commonly held to be of no importance in gait
#: analysis (McGinley et al. 2009, doi:10.1016/j.gaitpost.2008.09.003).
MARGIN_RAD = radians(5.0)
#: People below which curves cannot be compared.
_FEWEST_PEOPLE = 3
_DIGITS = 5


@dataclass(frozen=True, slots=True, eq=False)
class PersonGait:
    """Unperturbed strides of a person."""

    # (stride, node) angle without the device (NWC), rad; no rows if not recorded
    no_device: np.ndarray
    device: np.ndarray  # (stride, node) angle with the device (ENP), rad; no rows if not recorded
    # (stride, node) torque of the device on the joint by its current, nominally zero, N*m; rows as
    # ``device``
    torque: np.ndarray


def people_gait(study: Study, strides: Sequence[StrideRecord]) -> dict[str, PersonGait]:
    """Return the unperturbed strides of every person of a study."""
    return {person.id: _person(study, person.id, strides) for person in study.spec.participants}


def _person(study: Study, person: str, strides: Sequence[StrideRecord]) -> PersonGait:
    angles = {name: np.empty((0, NODES)) for name in ("no_device", "unperturbed")}
    torques = np.empty((0, NODES))
    for entry in study.spec.recordings:
        if entry.participant != person or entry.condition not in angles:
            continue
        own = [s for s in strides if s.recording == entry.file and s.participant == person]
        (recording,) = read_recording(study, entry)  # a simulated study has one trial a file
        angles[entry.condition] = stride_curves(recording, recording["angle"].to_numpy(), own)
        if entry.condition == "unperturbed" and study.spec.torque_model is not None:
            torque, _ = torque_from_current(recording, study.spec.torque_model, cutoff_hz=CUTOFF_HZ)
            torques = stride_curves(recording, torque, own)
    return PersonGait(angles["no_device"], angles["unperturbed"], torques)


def stride_curves(
    recording: xr.Dataset, values: np.ndarray, strides: Sequence[StrideRecord]
) -> np.ndarray:
    """Return a signal over the gait cycle, one row an accepted stride."""
    time = recording["time"].to_numpy()
    known = np.isfinite(values)
    step = float(np.median(np.diff(time)))
    even = np.arange(time[0], time[-1] + 0.5 * step, step)
    whole = np.interp(even, time[known], values[known])
    smooth = lowpass_zero_phase(whole, cutoff_hz=CUTOFF_HZ, rate_hz=1.0 / step)
    share = np.linspace(0.0, 1.0, NODES)
    kept = [s for s in strides if not s.code]
    rows = [np.interp(s.start_s + share * s.duration_s, even, smooth) for s in kept]
    return np.array(rows) if rows else np.empty((0, NODES))


def device_effect(gait: Mapping[str, PersonGait]) -> tuple[WaveformTest, WaveformTest] | None:
    """Compare the mean angle without and with the device, one pair of curves a person."""
    without, with_device = _mean_angles(gait)
    if len(without) < _FEWEST_PEOPLE:
        return None
    return (
        spm_paired_t(without, with_device, equivalence_margin=MARGIN_RAD),
        sign_flip_max_t(without, with_device, equivalence_margin=MARGIN_RAD),
    )


def _mean_angles(gait: Mapping[str, PersonGait]) -> tuple[np.ndarray, np.ndarray]:
    """Return mean angles without and with the device, of people who walked in both conditions."""
    both = [g for g in gait.values() if len(g.no_device) and len(g.device)]
    without = np.array([g.no_device.mean(axis=0) for g in both])
    return without, np.array([g.device.mean(axis=0) for g in both])


def stride_figure(gait: Mapping[str, PersonGait], person: str) -> dict[str, Any] | None:
    """Return what figure 4.2 draws; None where the person did not walk unperturbed."""
    shown = gait[person]
    if not len(shown.device):
        return None
    return {
        "person": person,
        "gait_pct": np.linspace(0.0, 100.0, NODES).tolist(),
        "angle_rad": shown.device.round(_DIGITS).tolist(),
        "torque_nm": shown.torque.round(_DIGITS).tolist(),
    }


def effect_figure(
    gait: Mapping[str, PersonGait], tests: tuple[WaveformTest, WaveformTest] | None
) -> dict[str, Any] | None:
    """Return what figure 4.3 draws; None without tests."""
    if tests is None:
        return None
    field, flips = tests
    without, with_device = _mean_angles(gait)
    return {
        "gait_pct": np.linspace(0.0, 100.0, NODES).tolist(),
        "t": list(field.t),
        "threshold": field.threshold,
        "flip_threshold": flips.threshold,
        "printed_threshold": printed_numbers.SPM_THRESHOLD.value,
        "no_device_rad": without.mean(axis=0).tolist(),
        "device_rad": with_device.mean(axis=0).tolist(),
        "difference_rad": list(field.difference),
        "low_rad": list(field.ci_low),
        "high_rad": list(field.ci_high),
        "margin_rad": MARGIN_RAD,
        "n_people": field.n_a,
    }


# --- study ---------------------------------------------------------------------------------------


#: Columns of the estimates of a simulated study.
COLUMNS = (
    "source", "participant", "timing_point", "onset_gait_pct", "parameter",
    "value", "ci_low", "ci_high", "status", "vaf_pct",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class WalkedStudy:
    """A simulated study of chapter IV."""

    people: tuple[str, ...]  # ids, in the order of the columns of tables 4.1 to 4.4
    # one row for each source (``dissertation``, ``recommended``, ``truth``), participant, timing
    # point and parameter, with value, interval, status and VAF; without a value where the estimate
    # was refused
    estimates: pd.DataFrame
    # means over people by the recommended method, columns of
    # :meth:`jointz.results.study_analysis.StudyAnalysis.population_frame`
    population: pd.DataFrame
    gait: Mapping[str, PersonGait]  # participant -> unperturbed strides

    def of(self, source: str, parameter: str) -> pd.DataFrame:
        """Return the rows of a source and parameter."""
        return rows_of(self.estimates, source, parameter)

    def at(
        self, source: str, parameter: str, timing_point: str, *, column: str = "value"
    ) -> list[float]:
        """Return what people have at a timing point; who has nothing is left out."""
        rows = self.of(source, parameter)
        values = rows.loc[rows["timing_point"] == timing_point, column].dropna()
        return [float(value) for value in values]


def walking_study(
    folder: Path,
    seed: int,
    preset: str,
    progress: Progress | None = None,
    *,
    run_progress: RunProgress | None = None,
    protocol: str | Protocol = "walking",
    resamples: int = DEFAULT_RESAMPLES,
) -> WalkedStudy:
    """Run the protocol of chapter IV on simulated people and analyse it once."""
    study = run_people(protocol, folder / "walking", seed, preset, run_progress)
    people = len(study.spec.participants)
    with open_engine(tasks=people, needs="jointz.analysis.participant_jobs") as engine:
        analysis = analyze(study, seed=seed, resamples=resamples, engine=engine, progress=progress)
    return walked(study, analysis)


def run_people(
    protocol: str | Protocol, out: Path, seed: int, preset: str, progress: RunProgress | None
) -> Study:
    """Run a protocol on simulated people, as many at once as there are cores."""
    workers = os.cpu_count() or 1
    made = run(protocol, out=out, seed=seed, preset=preset, workers=workers, progress=progress)
    return open_study(made.study)


def rows_of(estimates: pd.DataFrame, source: str, parameter: str) -> pd.DataFrame:
    """Return the rows of a source and parameter."""
    wanted = (estimates["source"] == source) & (estimates["parameter"] == parameter)
    return estimates[wanted]


def walked(study: Study, analysis: StudyAnalysis) -> WalkedStudy:
    """Set the estimates of an analysis beside the truth of its simulated study."""
    masses = {person.id: person.mass_kg for person in study.spec.participants}
    rows = [
        *estimated("recommended", analysis.cells),
        *estimated("dissertation", [c for c in analysis.comparison if c.method == "dissertation"]),
        *true_values(study.root, masses),
    ]
    return WalkedStudy(
        people=tuple(masses),
        estimates=pd.DataFrame(rows, columns=list(COLUMNS)),
        population=analysis.population_frame(),
        gait=people_gait(study, analysis.strides),
    )


def estimated(source: str, cells: Sequence[CellEstimate]) -> list[dict[str, Any]]:
    """Return the estimates of a method, one row a cell and parameter."""
    return [
        {
            "source": source,
            "participant": cell.participant,
            "timing_point": cell.timing_point,
            "onset_gait_pct": cell.onset_gait_pct,
            "parameter": p.name,
            **_numbers(source, p),
            "status": p.status,
            "vaf_pct": cell.vaf_pct,
        }
        for cell in cells
        for p in cell.parameters
        if p.name in PARAMETER_NAMES
    ]


def _numbers(source: str, p: ParameterEstimate) -> dict[str, float | None]:
    """Return value and interval; as published, also where the interval reaches zero."""
    published = source != "recommended" and p.status == "undecided"
    kept = p.available or published
    value = p.unbounded if published else p.value
    return {
        "value": value if kept else None,
        "ci_low": p.ci_low if kept else None,
        "ci_high": p.ci_high if kept else None,
    }


def true_values(study: Path, masses: Mapping[str, float | None]) -> list[dict[str, Any]]:
    """Return the truth of a simulated study in the rows of :func:`estimated`.

    The mean over the pulses of a timing point, each over its window, weighted with what the
    response tells of the parameter there: what a fit with constant parameters should find.
    """
    rows = []
    for person, mass in masses.items():
        points = study_truth(study, person)["perturbed"]["timing_points"]
        for point, truth in points.items():
            for name in PARAMETER_NAMES:
                per_mass = name.endswith("_per_mass")
                if per_mass and mass is None:
                    continue
                whole = truth[name.removesuffix("_per_mass")]
                rows.append(
                    {
                        "source": "truth",
                        "participant": person,
                        "timing_point": point,
                        "onset_gait_pct": truth["onset_gait_pct"],
                        "parameter": name,
                        "value": whole / mass if per_mass else whole,
                        "status": "ok",
                    }
                )
    return rows
