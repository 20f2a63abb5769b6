"""What an actuator can render: borders against simulations, passivity, files of actuators."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.control.made_cycles import made_cycles
from typer.testing import CliRunner

from jointz.cli.command_line import command_line
from jointz.control.profile_file import write_profile
from jointz.control.rendering.actuators import BUILT_IN, read_actuator
from jointz.control.rendering.check import (
    RenderingCheck,
    check_rendering,
    default_load_inertia,
    passive_stiffness,
    passivity_shortage,
    rendering_error,
    stability_border,
    stable_stiffness,
    stride_bandwidth_hz,
)
from jointz.control.rendering.varying import (
    floquet_multipliers,
    is_surely_stable,
    largest_multiplier,
)
from jointz.core.errors import DataError
from jointz.rig.sim.presets import ActuatorSettings

QDD, SEA = BUILT_IN["qdd"], BUILT_IN["sea"]
LOAD = 0.4
FILE = """
name = "bench"
source = "data sheet"
torque_nm = 60.0
delay_s = 0.002
time_constant_s = 0.004
control_hz = 1000.0
inertia = 0.02
viscous = 0.4
coulomb_nm = 0.5
"""


def final_swing(actuator, stiffness, damping, inertia, seconds=6.0):
    """Return |x| at the end of a simulation of the sampled loop, by its begin, of many laws."""
    fine = 4  # steps a control period; the inertia moves freely under a lagged torque
    step = 1.0 / actuator.control_hz / fine
    late = round(actuator.delay_s / step)
    keep = np.exp(-step / actuator.time_constant_s)
    moved = inertia + actuator.inertia
    x, v = np.ones_like(stiffness), np.zeros_like(stiffness)
    torque, held = np.zeros_like(x), np.zeros_like(x)
    queue = [np.zeros_like(x)] * (late + 1)
    swing = []
    for k in range(round(seconds / step)):
        if k % fine == 0:
            held = -stiffness * x - damping * v
        queue = [*queue[1:], held]
        torque = keep * torque + (1.0 - keep) * queue[0]
        v = v + step * (torque - actuator.viscous * v) / moved
        x = x + step * v
        swing.append(np.abs(x))
    tail = round(1.0 / step)
    return np.max(swing[-tail:], axis=0) / np.max(swing[tail : 2 * tail], axis=0)


@pytest.mark.parametrize("actuator", [QDD, SEA, replace(QDD, viscous=1.0)], ids=lambda a: a.name)
def test_border_of_stability_against_the_sampled_loop(actuator):
    damping = np.array([0.5, 2.0, 6.0, 20.0])
    limit = stable_stiffness(actuator, damping, LOAD)
    # Steps of the simulation cost a few percent; with 20 a control period both agree to 0.6 %.
    assert (final_swing(actuator, 0.95 * limit, damping, LOAD) < 1.0).all()
    assert (final_swing(actuator, 1.05 * limit, damping, LOAD) > 1.0).all()


@pytest.mark.parametrize("actuator", [QDD, SEA])
def test_limit_lies_on_the_border(actuator):
    w = np.linspace(1.0, 30.0, 50)
    stiffness, damping = stability_border(actuator, w, LOAD)
    inside = (stiffness > 0.0) & (damping > 0.0)
    assert inside.any()
    limit = stable_stiffness(actuator, damping[inside], LOAD)
    np.testing.assert_allclose(limit, stiffness[inside], rtol=1e-6)
    s, k, b = 1j * w, stiffness, damping
    rest = (LOAD + actuator.inertia) * s**2 + actuator.viscous * s
    lag = np.exp(-s * actuator.loop_delay_s) / (1.0 + s * actuator.time_constant_s)
    np.testing.assert_allclose(rest + (k + b * s) * lag, 0.0, atol=1e-9)


def test_too_much_damping_is_never_stable():
    assert stable_stiffness(QDD, [1000.0], LOAD)[0] == pytest.approx(0.0, abs=1e-6)
    assert stable_stiffness(QDD, [0.0], LOAD)[0] == pytest.approx(0.0, abs=1e-6)


def test_passivity_needs_friction():
    assert (passivity_shortage(QDD, [50.0], [2.0]) > 0.0).all()
    assert np.isnan(passive_stiffness(QDD, [2.0])[1]).all()
    rough = replace(QDD, viscous=10.0)
    assert (passivity_shortage(rough, [50.0], [2.0]) < 0.0).all()


def test_border_of_passivity_is_where_nothing_is_lacking():
    damping = np.array([0.0, 0.3, 0.6, 0.9])
    low, high = passive_stiffness(SEA, damping)
    assert (low == 0.0).all()
    np.testing.assert_allclose(passivity_shortage(SEA, high, damping), 0.0, atol=1e-9)
    assert (passivity_shortage(SEA, 1.01 * high, damping) > 0.0).all()
    # At frequencies near 0: viscous + B = K (T + D).
    slow = (SEA.viscous + damping[0]) / (SEA.time_constant_s + SEA.loop_delay_s)
    assert high[0] == pytest.approx(slow, rel=1e-3)


def test_a_passive_port_is_stable_with_every_load():
    damping = np.linspace(0.0, 0.9, 10)
    high = passive_stiffness(SEA, damping)[1]
    for load in (0.001, 0.01, 0.1, 1.0):
        assert (stable_stiffness(SEA, damping, load) >= 0.999 * high).all()


def test_stride_bandwidth(profile):
    turn = 2.0 * np.pi * profile.gait_pct / 100.0
    wave = replace(profile, angle=0.4 + 0.3 * np.cos(turn) + 0.02 * np.cos(3.0 * turn))
    assert stride_bandwidth_hz(wave) == pytest.approx(1.0 / profile.stride_s)
    wave = replace(profile, angle=0.4 + 0.3 * np.cos(turn) + 0.1 * np.cos(3.0 * turn))
    assert stride_bandwidth_hz(wave) == pytest.approx(3.0 / profile.stride_s)
    assert rendering_error(QDD, 3.0) > rendering_error(SEA, 3.0) > 0.0


# --- over the cycle ------------------------------------------------------------------------------


def test_multiplier_of_constant_impedance():
    stiffness, damping = np.full(100, 60.0), np.full(100, 1.0)
    found = floquet_multipliers(stiffness, damping, np.array(0.4), np.array(20.0), np.array(1.1))
    assert found == pytest.approx(np.exp(-1.0 / 0.8 * 1.1), rel=1e-6)
    rigid = floquet_multipliers(stiffness, 0.0 * damping, np.array(0.4), np.array(0.0), np.array(1))
    assert rigid == pytest.approx(1.0, rel=1e-6)


def test_multiplier_against_small_steps():
    rng = np.random.default_rng(0)
    turn = 2.0 * np.pi * np.arange(100) / 100.0
    stiffness = 60.0 + 50.0 * np.cos(2.0 * turn) + rng.normal(0.0, 3.0, 100)
    damping = 0.3 + 0.1 * np.sin(turn)
    for inertia, spring, stride_s in ((0.4, 0.0, 1.1), (0.2, 300.0, 0.9), (0.8, 50.0, 1.3)):
        loads = (np.array(one) for one in (inertia, spring, stride_s))
        found = floquet_multipliers(stiffness, damping, *loads)
        steps = 50_000
        at = (np.arange(steps) + 0.5) / steps * 100.0
        k = (np.interp(at, np.arange(100.0), stiffness, period=100.0) + spring) / inertia
        b = np.interp(at, np.arange(100.0), damping, period=100.0) / inertia
        h, state = stride_s / steps, np.eye(2)
        for ki, bi in zip(k, b, strict=True):
            half = 0.5 * h * np.array([[0.0, 1.0], [-ki, -bi]])
            state = np.linalg.solve(np.eye(2) - half, (np.eye(2) + half) @ state)
        assert found == pytest.approx(np.abs(np.linalg.eigvals(state)).max(), rel=1e-3)


def test_a_pumping_stiffness_is_found_and_damping_heals_it():
    turn = 2.0 * np.pi * np.arange(100) / 100.0
    stiffness = 60.0 + 50.0 * np.cos(4.0 * turn)
    weak = largest_multiplier(stiffness, np.full(100, 0.2), 1.1, LOAD)
    assert weak.multiplier > 1.0
    assert 0.5 * LOAD <= weak.inertia <= 2.0 * LOAD
    assert 0.0 <= weak.spring <= 600.0 * (1.0 + 1e-9)
    assert 0.88 <= weak.stride_s <= 1.32
    assert largest_multiplier(stiffness, np.full(100, 6.0), 1.1, LOAD).multiplier < 1.0


def test_refined_search_misses_no_load():
    rng = np.random.default_rng(1)
    turn = 2.0 * np.pi * np.arange(100) / 100.0
    stiffness = 40.0 + 35.0 * np.cos(3.0 * turn)
    damping = np.full(100, 0.15)
    found = largest_multiplier(stiffness, damping, 1.1, LOAD)
    loads = (
        LOAD * rng.uniform(0.5, 2.0, 4000),
        40.0 * 10.0 * rng.uniform(0.0, 1.0, 4000) ** 4,
        1.1 * rng.uniform(0.8, 1.2, 4000),
    )
    assert floquet_multipliers(stiffness, damping, *loads).max() <= 1.01 * found.multiplier


@pytest.mark.parametrize(
    "cycle",
    [
        pytest.param(cycle, id=cycle.name, marks=() if k % 5 == 0 else pytest.mark.slow)
        for k, cycle in enumerate(made_cycles())
    ],
)
def test_growth_in_separate_simulations_is_found(cycle):
    found = largest_multiplier(cycle.stiffness, cycle.damping, cycle.stride_s, LOAD)
    assert found.multiplier >= cycle.growth - 0.003
    assert (found.multiplier > 1.0) == cycle.unsafe


def test_sufficient_condition_never_contradicts_the_multipliers():
    rng = np.random.default_rng(2)
    turn = 2.0 * np.pi * np.arange(100) / 100.0
    sure = 0
    for _ in range(8):
        stiffness = 60.0 * (1.0 + rng.uniform(0.0, 0.6) * np.cos(rng.integers(1, 4) * turn))
        damping = rng.uniform(0.5, 8.0) * (1.0 + rng.uniform(0.0, 0.3) * np.sin(turn))
        if is_surely_stable(stiffness, damping, 1.1, LOAD):
            sure += 1
            assert largest_multiplier(stiffness, damping, 1.1, LOAD).multiplier < 1.0
    assert 0 < sure < 8
    assert is_surely_stable(np.full(100, 60.0), np.full(100, 1.0), 1.1, LOAD)


# --- actuators and the command -------------------------------------------------------------------


def test_actuator_from_a_file(tmp_path):
    file = tmp_path / "bench.toml"
    file.write_text(FILE, encoding="utf-8")
    actuator = read_actuator(str(file))
    assert (actuator.name, actuator.torque_nm, actuator.viscous) == ("bench", 60.0, 0.4)
    assert actuator.loop_delay_s == pytest.approx(0.0025)


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        (("torque_nm = 60.0", "torqe_nm = 60.0"), ["torqe_nm", "torque_nm", "missing"]),
        (("delay_s = 0.002", "delay_s = -1.0\nstiffness = 3.0"), ["delay_s", "stiffness: unknown"]),
        (("inertia = 0.02", 'inertia = "0.02"'), ["inertia: expected a number"]),
        (("control_hz = 1000.0", "control_hz = nan"), ["control_hz: expected a finite number"]),
        (("viscous = 0.4", "viscous = = 0.4"), ["not valid TOML"]),
    ],
)
def test_bad_actuator_files(change, texts, tmp_path):
    file = tmp_path / "bench.toml"
    file.write_text(FILE.replace(*change), encoding="utf-8")
    with pytest.raises(DataError) as caught:
        read_actuator(str(file))
    for text in texts:
        assert text in str(caught.value)


def test_no_such_actuator(tmp_path):
    with pytest.raises(DataError, match="expected qdd or sea, or a TOML file"):
        read_actuator(str(tmp_path / "none.toml"))


@pytest.mark.parametrize("actuator", BUILT_IN.values(), ids=BUILT_IN)
def test_built_in_actuators_name_what_is_assumed(actuator):
    assert "dissertation" in actuator.source
    assert "Assumed" in actuator.source


def test_the_quasi_direct_drive_has_what_the_simulated_rig_has():
    drive, simulated = read_actuator("qdd"), ActuatorSettings()
    assert drive.delay_s == simulated.delay_s
    assert drive.time_constant_s == simulated.time_constant_s
    assert drive.torque_nm == pytest.approx(9 * 0.11 * simulated.current_max_a)


def test_check_of_a_strong_actuator(profile):
    strong = replace(SEA, torque_nm=200.0, viscous=4.0, delay_s=0.0, time_constant_s=0.001)
    found = check_rendering(profile, strong)
    assert found.can_render
    assert all(one.holds for one in found.findings)
    assert found["torque"].value == pytest.approx(
        (np.abs(profile.moment) + 0.1 * profile.stiffness).max()
    )
    assert found.load_inertia == default_load_inertia(profile)
    assert RenderingCheck.from_dict(found.to_dict()) == found
    assert "can be rendered" in found.summary()
    found.plot()


def test_each_condition_can_fail(profile):
    weak = check_rendering(profile, replace(SEA, torque_nm=5.0, delay_s=0.05))
    assert not any(weak[name].holds for name in ("torque", "stable", "faithful"))
    assert not weak.can_render
    none = replace(profile, damping=0.01 * profile.damping)
    assert not check_rendering(none, SEA)["varying"].holds


def test_bad_loads_are_refused(profile):
    for bad in ({"load_inertia": 0.0}, {"share": 0.0}, {"share": 1.5}, {"load_inertia": np.nan}):
        with pytest.raises(DataError, match="expected a load inertia"):
            check_rendering(profile, SEA, **bad)
    with pytest.raises(DataError, match="no default for the ankle"):
        check_rendering(replace(profile, joint="ankle"), SEA)


def test_command(profile, tmp_path, monkeypatch):
    file = write_profile(profile, tmp_path / "S01.json")
    (tmp_path / "bench.toml").write_text(FILE, encoding="utf-8")

    def run(*arguments):
        return CliRunner().invoke(command_line(), ["control", "check", str(file), *arguments])

    good = run("--actuator", str(tmp_path / "bench.toml"), "--figure", str(tmp_path / "f.svg"))
    assert good.exit_code == 0, good.output
    assert "can be rendered" in good.output
    assert (tmp_path / "f.svg").is_file()
    poor = run("--json")
    assert poor.exit_code == 1
    assert '"can_render": false' in poor.output
    known = RenderingCheck.from_dict(json.loads(poor.output))
    monkeypatch.setattr("jointz.control.rendering.check.check_rendering", lambda *_, **__: known)
    assert run("--quiet", "--actuator", "qdd").output == ""
    assert isinstance(run("--actuator", "none").exception, DataError | SystemExit)
