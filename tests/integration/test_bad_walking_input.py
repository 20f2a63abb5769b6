"""Walks that cannot be estimated: each is a status and a reason in plain words, never a number."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pytest

from jointz.core.codes import Failure
from jointz.rig.sim.descriptions import exoskeleton
from jointz.rig.sim.direct_walk import QUICK_GRID, WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig

POINTS = {"LRE": 7.0, "ISW": 68.5}
COLUMNS = ["angle", "current", "motor_angle", "motor_velocity", "contact"]
UNITS = {"angle": "rad", "current": "A", "motor_angle": "rad", "motor_velocity": "rad/s"}


Spoilt = tuple[pd.DataFrame, pd.DataFrame]


@dataclass(frozen=True)
class Walk:
    """What was recorded of a simulated walk, and its pulses."""

    samples: pd.DataFrame
    pulses: pd.DataFrame
    toml: str

    def at(self, after_s: float) -> np.ndarray:
        """Return the first samples that are so long after each onset."""
        return np.searchsorted(self.samples["time"], self.pulses["onset_s"] + after_s)


@pytest.fixture(scope="module")
def walk() -> Walk:
    rig = SimulatedRig(draw_person(3, seed=41), preset("nominal"), grid=QUICK_GRID)
    walked = walk_directly(rig, "perturbed", plan=WalkPlan(per_point=15, timing_points=POINTS))
    samples = pd.DataFrame({"time": walked.time_s} | {c: walked.channels[c] for c in COLUMNS})
    columns = ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
    model = exoskeleton(rig.build(worn=True)).torque_model
    known = model.model_dump(exclude_none=True, exclude_defaults=True)
    lines = ["jointz = 1", 'joint = "knee"', 'kind = "walking"', 'coupling = "rigid"']
    lines += ['positive = "flexion"', 'torque_acts_on = "joint"']
    lines += ['[channels.time]\ncolumn = "time"\nunit = "s"']
    lines += [f'[channels.{c}]\ncolumn = "{c}"\nunit = "{unit}"' for c, unit in UNITS.items()]
    lines += ['[channels.contact]\ncolumn = "contact"\nkind = "contact"', "[torque_model]"]
    lines += [f"{name} = {value}" for name, value in known.items()]
    lines += ["[perturbations]", "timing_points = { LRE = 7.0, ISW = 68.5 }"]
    lines += ['[[participants]]\nid = "S01"\nmass_kg = 70.0']
    lines += ['[[recordings]]\nparticipant = "S01"\ncondition = "perturbed"\nfile = "walk.csv"']
    lines += ['perturbations = "pulses.csv"']
    return Walk(samples, walked.pulses[columns], "\n".join(lines) + "\n")


def saturated(walk: Walk) -> Spoilt:
    top = 0.6 * walk.samples["current"].to_numpy()[walk.at(0.1)].mean()
    return walk.samples.assign(current=walk.samples["current"].clip(-top, top)), walk.pulses


def never_reached(walk: Walk) -> Spoilt:
    """The joint moves on as it had one stride before; only the torque tells of pulses."""
    time, contact = walk.samples["time"].to_numpy(), walk.samples["contact"].to_numpy() > 0.5
    strikes = time[1:][contact[1:] & ~contact[:-1]]
    angle = walk.samples["angle"].to_numpy()
    moved = angle.copy()
    for onset in walk.pulses["onset_s"]:
        last = np.searchsorted(strikes, onset) - 1
        stride = strikes[last] - strikes[last - 1]
        inside = (time >= onset) & (time < onset + 0.9)
        level = np.interp(onset, time, angle) - np.interp(onset - stride, time, angle)
        moved[inside] = np.interp(time[inside] - stride, time, angle) + level
    return walk.samples.assign(angle=moved), walk.pulses


def late(walk: Walk) -> Spoilt:
    return walk.samples.assign(angle=np.roll(walk.samples["angle"], 30)), walk.pulses


def table_a_stride_late(walk: Walk) -> Spoilt:
    return walk.samples, walk.pulses.assign(onset_s=walk.pulses["onset_s"] + 1.1)


def too_few_strides(walk: Walk) -> Spoilt:
    last = walk.pulses["onset_s"].iloc[1] + 1.5
    return walk.samples[walk.samples["time"] < last], walk.pulses.iloc[:2]


def copies(walk: Walk) -> Spoilt:
    """Every pulse of a timing point has the samples of its first."""
    samples, at = walk.samples.copy(), walk.at(0.0)
    for point in POINTS:
        own = at[(walk.pulses["timing_point"] == point).to_numpy()]
        for name in COLUMNS[:-1]:
            values = samples[name].to_numpy(copy=True)
            for k in own[1:]:
                values[k - 20 : k + 200] = values[own[0] - 20 : own[0] + 200]
            samples[name] = values
    return samples, walk.pulses


def turned(walk: Walk) -> Spoilt:
    return walk.samples.assign(angle=-walk.samples["angle"]), walk.pulses


@pytest.fixture
def analysed(walk, jointz, tmp_path):
    """Return how samples and pulses are analysed: what the command says, and its results."""

    def analysed(samples, pulses):
        study, out = tmp_path / "study", tmp_path / "results"
        study.mkdir()
        samples.round(7).to_csv(study / "walk.csv", index=False)
        pulses.to_csv(study / "pulses.csv", index=False)
        (study / "study.toml").write_text(walk.toml)
        quick = ("--resamples", 50, "--no-figures", "--workers", 1)
        return jointz("analyze", study, "--out", out, *quick), out

    return analysed


def test_the_walk_itself_is_estimated(walk, analysed):
    outcome, out = analysed(walk.samples, walk.pulses)
    assert outcome.code == 0
    table = pd.read_csv(out / "estimates.csv")
    assert set(table["status"]) <= {"ok", "at_bound", "undecided"}
    assert table["value"].notna().sum() >= 6


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (saturated, Failure.TORQUE_SATURATED),
        (never_reached, Failure.CONSTANT_ANGLE),
        (late, Failure.LAG_OUT_OF_RANGE),
        (table_a_stride_late, Failure.OUT_OF_STEP),
        (too_few_strides, Failure.NO_UNPERTURBED_STRIDES),
        (turned, Failure.OPPOSITE_SIGN),
    ],
    ids=lambda given: getattr(given, "__name__", str(given)),
)
def test_what_cannot_be_estimated_says_why_on_terminal_in_tables_and_report(
    walk, analysed, spoil, code
):
    outcome, out = analysed(*spoil(walk))
    table = pd.read_csv(out / "estimates.csv")
    assert set(table["status"]) == {code.status}
    assert table["value"].isna().all()
    assert outcome.code == 1
    assert code.status in outcome.out
    assert code.meaning in (out / "report.html").read_text()


def test_copies_of_one_pulse_count_once(walk, analysed):
    _, out = analysed(*copies(walk))
    excluded = pd.read_csv(out / "excluded.csv")
    assert (excluded["code"] == "copied_pulse").sum() == 28
    assert (pd.read_csv(out / "estimates.csv")["n_used"] <= 1).all()


def test_degrees_declared_as_radians_stop_the_job_and_name_the_unit(walk, analysed):
    samples = walk.samples.assign(angle=np.rad2deg(walk.samples["angle"]))
    outcome, _ = analysed(samples, walk.pulses)
    assert outcome.code == 2
    assert "deg declared as rad" in outcome.err
