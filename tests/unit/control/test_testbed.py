"""Test bed: its physics, what controllers do in it, and their comparison."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from jointz.cli.command_line import command_line
from jointz.control.controllers import PhaseController, PhaseTables, controller_tables
from jointz.control.profile_file import write_profile
from jointz.control.testbed.bed_laws import OTHERS, REFERENCE, mean_profile
from jointz.control.testbed.compare import compare_controllers
from jointz.control.testbed.knee_bed import Walk, acceleration, knee_bed, walk_through
from jointz.control.testbed.page import write_page
from jointz.control.testbed.scores import TESTS, drawn_walk, intact_angle, push_scores, run_scores
from jointz.core.errors import DataError, OutputError
from jointz.experiment.controllers import ControlState

FREE = {"delay_steps": 0, "lag_s": 0.0, "limit_nm": 1e6}


def law(name, profile, **settings):
    tables = controller_tables(name, profile, settings)
    return np.column_stack(
        [tables.feedforward, tables.stiffness, tables.damping, tables.equilibrium]
    )


def strides(bed, count=3, **changes):
    """Equal strides without any error."""
    settings = {**FREE, **changes}
    return Walk(
        np.full(count, 1.0 / bed.stride_s), np.zeros(count), np.zeros(count + 1), **settings
    )


def deviation(bed, record):
    return record[:, 1] - intact_angle(bed, record[:, 0])


def test_the_intact_motion_is_a_solution(published):
    bed = knee_bed(published, load_share=1.0)
    angle = bed.column("angle")
    orders = 2j * np.pi * np.fft.rfftfreq(angle.size, 1.0 / angle.size) / bed.stride_s
    velocity, bend = (np.fft.irfft(np.fft.rfft(angle) * orders**k, angle.size) for k in (1, 2))
    for n in range(0, angle.size, 37):
        torque = published.at("moment", 100.0 * n / angle.size)
        found = acceleration(bed, 100.0 * n / angle.size, angle[n], velocity[n], float(torque))
        assert found == pytest.approx(bend[n], abs=1e-6)


def test_replayed_moment_keeps_the_intact_motion_until_its_errors_grow(published):
    bed = knee_bed(published, load_share=0.0)
    # A torque that is held for 2 ms is 1 ms late.
    walk = replace(strides(bed, 1), phase_error=np.array([0.001 / bed.stride_s]))
    record, fallen = walk_through(bed, law("torque_replay", published), walk)
    assert np.abs(deviation(bed, record)).max() < 5e-3
    assert not fallen.any()


def test_joint_work_is_the_change_of_energy(published):
    bed = knee_bed(published)
    tables = np.zeros_like(bed.tables)
    tables[:, bed.tables.shape[1] - 3] = 0.3  # the leg hangs from a thigh at rest
    constants = bed.constants.copy()
    constants[-1] = -9.0  # no stop
    still = replace(bed, tables=tables, constants=constants)
    record, fallen = walk_through(still, np.tile([6.0, 0.0, 0.0, 0.0], (100, 1)), strides(bed, 1))
    _, angle, velocity, torque, _ = record.T
    body = bed.body
    energy = 0.5 * body.inertia * velocity**2 - 9.81 * body.mass_centre * np.cos(angle)
    work = np.concatenate([[0.0], np.cumsum(np.diff(angle) * 0.5 * (torque[1:] + torque[:-1]))])
    assert not fallen.any()
    assert np.ptp(energy) > 1.0
    np.testing.assert_allclose(energy - energy[0], work, atol=1e-6)


def test_law_in_the_bed_is_the_controllers(published):
    bed = knee_bed(published)
    record, fallen = walk_through(bed, law(REFERENCE, published), strides(bed))
    tables: PhaseTables = controller_tables(REFERENCE, published)
    controller = PhaseController(tables, 1.0, {})
    asked = [
        controller.torque(
            ControlState(0.0, 100.0 * phase % 100.0, angle, velocity, 0.0, 5), {"share": 1.0}
        )
        for phase, angle, velocity, _, _ in record[:-1]
    ]
    assert not fallen.any()
    np.testing.assert_allclose(record[1:, 3], asked, atol=1e-9)


def test_a_knee_without_torque_buckles_under_load_in_every_stride(published):
    bed = knee_bed(published)
    record, fallen = walk_through(bed, law("zero_torque", published), strides(bed))
    last = np.flatnonzero(np.isfinite(record[:, 1]))[-1]
    assert fallen.all()
    assert record[last, 1] > np.radians(45.0)
    assert record[last, 0] % 1.0 < 0.62


def test_a_stiff_pd_holds_the_load_unless_it_is_late_or_soft(published):
    bed = knee_bed(published)
    stiff = law("kinematic_pd", published, stiffness=300.0, damping=10.0)
    record, fallen = walk_through(bed, stiff, strides(bed))
    assert not fallen.any()
    late = walk_through(bed, stiff, strides(bed, delay_steps=60))[1]
    assert late.all()
    soft = law("kinematic_pd", published, stiffness=10.0, damping=2.0)
    assert walk_through(bed, soft, strides(bed))[1].all()
    stiffer = law("kinematic_pd", published, stiffness=600.0, damping=14.0)
    assert np.std(deviation(bed, walk_through(bed, stiffer, strides(bed))[0])) < np.std(
        deviation(bed, record)
    )


def test_a_push_flexes_the_knee_and_only_after_it(published):
    bed = knee_bed(published)
    nodes = law(REFERENCE, published)
    calm = walk_through(bed, nodes, strides(bed))[0]
    push = {"push_nm": 15.0, "push_at": 1.2, "push_s": 0.1}
    pushed = walk_through(bed, nodes, strides(bed, **push))[0]
    before = calm[:, 0] < 1.2
    np.testing.assert_array_equal(pushed[before], calm[before])
    after = (calm[:, 0] > 1.21) & (calm[:, 0] < 1.25)
    assert (pushed[after, 1] > calm[after, 1]).all()


def test_scores_of_the_intact_motion(published):
    bed = knee_bed(published)
    phase = np.arange(0.0, 2.0, 0.002 / bed.stride_s)
    angle = intact_angle(bed, phase)
    velocity = np.gradient(angle, 0.002)
    torque = published.at("moment", 100.0 * phase)
    toe = np.interp(phase, np.arange(5000) / 5000, bed.toe_m(), period=1.0)
    record = np.column_stack([phase, angle, velocity, torque, toe])
    scores = run_scores(bed, record, np.zeros(2, dtype=bool))
    assert scores["tracking"] == pytest.approx(0.0, abs=1e-9)
    assert scores["clearance"] == pytest.approx(0.0, abs=1e-4)
    assert scores["net_work"] == pytest.approx(published.energy_j, abs=0.3)
    assert scores["falls"] == scores["fallen_strides"] == 0.0


def test_scores_of_a_known_push(published):
    bed = knee_bed(published)
    plain = walk_through(bed, law(REFERENCE, published), strides(bed, 12))[0]
    pushed = plain.copy()
    for first in (2.2, 5.2, 8.2):
        since = (plain[:, 0] - first) * bed.stride_s
        pushed[:, 1] += np.where((since >= 0.0) & (since < 1.0), 0.1 * np.exp(-since / 0.1), 0.0)
    scores = push_scores(pushed, plain, 0.2)
    assert scores["push_deviation"] == pytest.approx(np.degrees(0.1), rel=0.05)
    assert scores["return_time"] == pytest.approx(0.1 * np.log(3.0), abs=0.004)


def test_draws_go_by_the_seed(published):
    bed = knee_bed(published)
    walks = [drawn_walk(TESTS["plain"], bed, (1, 0, seed)) for seed in (0, 0, 1)]
    np.testing.assert_array_equal(walks[0].rate_hz, walks[1].rate_hz)
    assert (walks[0].rate_hz != walks[2].rate_hz).all()
    # Tests have the same strides, so that a push can be compared with none.
    pushed = drawn_walk(TESTS["push_swing"], bed, (1, 0, 0))
    np.testing.assert_array_equal(walks[0].thigh, pushed.thigh)


def test_mean_of_equals_is_each_of_them_by_mass(published):
    heavy = published.for_mass(2.0 * published.mass_kg)
    mean = mean_profile([published, heavy], published.mass_kg)
    for name in ("stiffness", "damping", "equilibrium", "moment"):
        np.testing.assert_allclose(getattr(mean, name), getattr(published, name), atol=1e-9)


def people(published, count):
    return [replace(published.for_mass(60.0 + 5.0 * n), subject=f"S{n:02d}") for n in range(count)]


@pytest.fixture(scope="module")
def comparison(published):
    return compare_controllers(people(published, 3), seeds=1)


def test_comparison_is_the_same_again(published):
    first, again, other = (
        compare_controllers([published], seeds=1, seed=seed) for seed in (1, 1, 2)
    )
    assert [run.scores for run in again.runs] == [run.scores for run in first.runs]
    assert [run.scores for run in other.runs] != [run.scores for run in first.runs]


def test_tables_of_a_comparison(comparison):
    frame = comparison.to_frame()
    assert len(frame) == 3 * 11 * len(TESTS)
    own = frame[(frame["controller"] == REFERENCE) & (frame["test"] == "plain")]["tracking"]
    mean = comparison.mean(REFERENCE, "plain", "tracking")
    assert mean.mean == pytest.approx(own.mean())
    assert mean.ci_high - mean.mean == pytest.approx(4.302653 * own.std() / np.sqrt(3.0), rel=1e-5)
    zero = frame[(frame["controller"] == "zero_torque") & (frame["test"] == "plain")]["tracking"]
    (away,) = (
        d for d in comparison.differences
        if (d.controller, d.test, d.score) == ("zero_torque", "plain", "tracking")
    )  # fmt: skip
    assert away.mean == pytest.approx(zero.mean() - own.mean())
    assert all(-1.0 <= c.rho <= 1.0 for c in comparison.correlations if c.rho is not None)
    assert "impedance_per_phase" in comparison.summary()
    assert comparison.plot().get_xlabel()


def test_one_person_has_neither_others_nor_intervals(published):
    found = compare_controllers([published], seeds=1)
    assert OTHERS not in found.controllers
    assert all(mean.ci_low is None for mean in found.means)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"joint": "ankle"}, "expected a knee"), ({"positive": "extension"}, "positive flexion")],
)
def test_other_joints_are_refused(published, change, message):
    with pytest.raises(DataError, match=message):
        compare_controllers([replace(published, **change)])


def test_bad_input_is_refused(published):
    with pytest.raises(DataError, match="several profiles of published"):
        compare_controllers([published, published])
    with pytest.raises(DataError, match="no profile"):
        compare_controllers([])
    with pytest.raises(DataError, match="0 to 1"):
        knee_bed(published, load_share=2.0)
    with pytest.raises(DataError, match="count as a fall"):
        knee_bed(replace(published, angle=published.angle - 0.5))
    with pytest.raises(DataError, match="seeds"):
        compare_controllers([published], seeds=0)


def test_page_of_a_comparison(comparison, tmp_path):
    page = write_page(comparison, tmp_path / "out")
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") == 3
    assert "quasi_stiffness" in text
    assert len((tmp_path / "out" / "table.csv").read_text().splitlines()) == 1 + len(
        comparison.runs
    )
    with pytest.raises(OutputError, match="exists"):
        write_page(comparison, tmp_path / "out")


def test_command(published, tmp_path):
    files = [str(write_profile(p, tmp_path / f"{p.subject}.json")) for p in people(published, 2)]
    out = tmp_path / "page"

    def run(*arguments):
        return CliRunner().invoke(command_line(), ["control", "compare", *files, *arguments])

    answer = run("--seeds", "1", "--out", str(out), "--json")
    content = json.loads(answer.stdout)
    assert content["status"] == "ok"
    assert content["participants"] == ["S00", "S01"]
    assert (out / "page.html").is_file()
    again = run("--out", str(out))
    assert again.exit_code != 0
