"""Physics of the muscled leg: pendulum, ground, muscles, reflex delay, and equal seeds."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="mujoco (dependency group worlds) is not installed")

from benchmarks.worlds import gait, make, person, truth  # noqa: E402
from benchmarks.worlds import leg as lg  # noqa: E402
from benchmarks.worlds import muscles as mu  # noqa: E402


@pytest.fixture(scope="module")
def someone() -> person.Person:
    return person.draw_person(3, 0)


@pytest.fixture(scope="module")
def walker(someone: person.Person) -> lg.Leg:
    return lg.Leg(someone, *gait.build_table(someone))


def test_the_shank_is_a_pendulum_of_the_closed_form(someone: person.Person) -> None:
    model = lg.build_model(someone, with_arm=False)
    data = mujoco.MjData(model)
    shank, foot = someone.shank, someone.foot
    drop, forward = shank.length + 0.04, 0.3 * foot.length
    inertia = shank.inertia + shank.mass * shank.centre**2
    inertia += foot.inertia + foot.mass * (drop**2 + forward**2)
    moment = person.GRAVITY * np.hypot(
        shank.mass * shank.centre + foot.mass * drop, foot.mass * forward
    )
    rest = np.arctan2(foot.mass * forward, shank.mass * shank.centre + foot.mass * drop)
    # The other joints are held by taking only the knee's row of the equations of motion
    angle, speed, crossings = rest + 0.05, 0.0, []
    for step in range(8000):
        data.qpos[:] = 0.0
        data.qpos[lg.KNEE] = angle
        mujoco.mj_forward(model, data)
        matrix = np.zeros(6)
        mujoco.mj_mulM(model, data, matrix, np.eye(6)[lg.KNEE])
        speed -= lg.DT * data.qfrc_bias[lg.KNEE] / matrix[lg.KNEE]
        before, angle = angle, angle + lg.DT * speed
        if before < rest <= angle:
            crossings.append(step * lg.DT)
    period = np.diff(crossings).mean()
    assert period == pytest.approx(2 * np.pi * np.sqrt(inertia / moment), rel=2e-3)


def test_ground_forces_are_those_of_mujoco(walker: lg.Leg) -> None:
    q = np.array([0.1, -0.05, 0.3, 0.5, -0.2])
    data = mujoco.MjData(walker.model)
    data.qpos[:5] = q
    mujoco.mj_forward(walker.model, data)
    foot = 4
    place = data.xpos[foot] + data.xmat[foot].reshape(3, 3) @ [0.08, 0.0, -0.06]
    expected = np.zeros(6)
    force = np.array([30.0, 0.0, 700.0])
    mujoco.mj_applyFT(walker.model, data, force, np.zeros(3), place, foot, expected)
    ours = lg.ground_forces(walker.body[:2], q, np.zeros(5), 0.08, -0.06, 30.0, 700.0)
    assert ours == pytest.approx(expected[:5])


def test_inertia_is_torque_over_acceleration(walker: lg.Leg) -> None:
    q = np.append(walker.table[800, :5], walker.table[800, lg.KNEE])
    speeds = []
    for torque in (0.0, 10.0):
        data = mujoco.MjData(walker.model)
        data.qpos[:], data.qfrc_applied[lg.KNEE] = q, torque
        mujoco.mj_step(walker.model, data)
        speeds.append(data.qvel[lg.KNEE])
    _, free, thigh_held = truth.inertias(walker, q, 0.8)
    assert free == pytest.approx(10.0 * lg.DT / (speeds[1] - speeds[0]), rel=1e-3)
    assert free < thigh_held


def _hold(par: np.ndarray, fibre: float, activation: float, seconds: float) -> tuple:
    """Hold a muscle at the length that has this fibre length at rest; return length and state."""
    wanted = activation * mu.force_length(fibre) + mu.passive_force(fibre)
    strains = np.linspace(0.0, 0.1, 4000)
    forces = np.array([mu.tendon_force(s, par[mu.TENDON_STRAIN]) for s in strains])
    tendon = par[mu.L_SLACK] * (1 + np.interp(wanted * par[mu.COS_PENNATION], forces, strains))
    length = tendon + fibre * par[mu.L_OPT] * par[mu.COS_PENNATION]
    state = np.array([activation, fibre, 0.0, 0.0])
    for _ in range(round(seconds / lg.DT)):
        force = mu.step_muscle(par, state, length, 0.0, activation, activation, lg.DT)
    return length, state, force


@pytest.mark.parametrize("fibre", [0.7, 0.9, 1.0])
def test_isometric_force_is_on_the_force_length_curve(someone: person.Person, fibre: float) -> None:
    par = someone.muscles[0]
    _, state, force = _hold(par, fibre, 0.5, 0.5)
    expected = 0.5 * np.exp(-(((fibre - 1) / 0.5) ** 2)) * par[mu.COS_PENNATION] * par[mu.F_MAX]
    assert state[mu.FIBRE] == pytest.approx(fibre, abs=0.01)
    assert force == pytest.approx(expected, rel=0.02)


def test_short_range_stiffness_yields(someone: person.Person) -> None:
    par = someone.muscles[0].copy()
    par[mu.TENDON_STRAIN] = 0.001  # a rigid tendon shows the fibre alone
    stiffness = []
    for stretch in (0.001, 0.03):
        length, state, before = _hold(par, 0.95, 0.3, 0.5)
        rate = stretch * par[mu.L_OPT] * par[mu.COS_PENNATION] / 0.02
        for i in range(40):
            now = length + rate * i * lg.DT
            mu.step_muscle(par, state, now, rate, 0.3, 0.3, lg.DT)
        for _ in range(20):  # the force of speed fades, the bridges hold
            force = mu.step_muscle(par, state, now, 0.0, 0.3, 0.3, lg.DT)
        stiffness.append((force - before) / (now - length))
    expected = par[mu.SRS_GAIN] * before / par[mu.L_OPT]
    assert 0.6 * expected < stiffness[0] < 1.2 * expected
    assert stiffness[1] < 0.5 * stiffness[0]


def test_reflexes_come_after_their_delay(someone: person.Person) -> None:
    leg = lg.Leg(someone, *gait.build_table(someone))
    rng = np.random.default_rng(0)
    inputs = gait.make_inputs(someone, gait.make_strides(someone, 6, rng), rng)
    start = 6000
    leg.run(tuple(a[:start] for a in inputs))
    saved, runs = leg.save(), []
    for torque in (0.0, 17.0):
        leg.load(saved)
        part = tuple(a[start : start + 300].copy() for a in inputs)
        part[4][:] = torque
        runs.append(leg.run(part)[:, lg.O_ACTIVATION :])
    apart = np.flatnonzero(np.abs(runs[1] - runs[0]).max(axis=1) > 1e-9)[0]
    assert someone.reflex_delay_s <= apart * lg.DT + lg.DT < someone.reflex_delay_s + 0.02


def test_equal_seeds_give_equal_studies(tmp_path) -> None:
    for name in ("a", "b"):
        make.make_study(tmp_path / name, 1, "doublets", 5, per_point=1, minutes=0.3)
    for file in ("study.toml", "truth.json", "P00_perturbed.csv", "P00_unperturbed.csv"):
        assert (tmp_path / "a" / file).read_text() == (tmp_path / "b" / file).read_text()
