"""``jointz identify static`` and ``dither``."""

import numpy as np
import pandas as pd
import pytest

STIFFNESS, DAMPING, FRICTION, INERTIA = 146.0, 0.4, 1.5, 0.02
OMEGA = 2 * np.pi * 5.0
COLUMNS = ("--angle", "q:deg", "--torque", "tau:Nm")


def noise(size):
    return 0.05 * np.random.default_rng(0).standard_normal(size)


def write(path, time, angle, torque, **more):
    table = {"t": time, "q": np.rad2deg(angle), "tau": torque} | more
    pd.DataFrame(table).to_csv(path, index=False)
    return path


@pytest.fixture
def slow(tmp_path):
    """A slow record with friction against the motion."""
    time = np.arange(6000) / 100.0
    way = np.sign(np.cos(2 * np.pi * 0.1 * time))
    angle = 0.07 * np.sin(2 * np.pi * 0.1 * time)
    torque = STIFFNESS * angle + FRICTION * way + noise(time.size)
    return write(tmp_path / "slow.csv", time, angle, torque, way=way)


@pytest.fixture
def fast(tmp_path):
    """A dither that accelerates a known inertia."""
    time = np.arange(30_000) / 500.0
    angle = 0.007 * np.sin(OMEGA * time)
    load = (STIFFNESS - INERTIA * OMEGA**2) * angle
    torque = load + DAMPING * 0.007 * OMEGA * np.cos(OMEGA * time) + noise(time.size)
    return write(tmp_path / "fast.csv", time, angle, torque)


DITHER = (*COLUMNS, "--rate", 500, "--frequency-hz", 5)


def test_static_json_holds_stiffness_and_friction_with_units_and_intervals(jointz, slow):
    figure = slow.with_name("fit.svg")
    options = ("--time", "t", "--direction", "way", "--figure", figure, "--json")
    outcome = jointz("identify", "static", slow, *COLUMNS, *options)

    assert outcome.code == 0
    found = outcome.json
    assert (found["model"], found["status"]) == ("static", "ok")
    stiffness = found["parameters"]["stiffness"]
    assert stiffness["value"] == pytest.approx(STIFFNESS, rel=0.01)
    assert stiffness["unit"] == "N*m/rad"
    assert stiffness["ci"][0] < stiffness["value"] < stiffness["ci"][1]
    assert found["parameters"]["coulomb_friction"]["value"] == pytest.approx(FRICTION, abs=0.05)
    assert found["columns"]["angle"] == {"column": "q", "unit": "deg"}
    assert found["columns"]["direction"]["column"] == "way"
    assert "series" not in found
    assert figure.stat().st_size > 1000


def test_static_prints_a_row_a_parameter_unless_it_is_quiet(jointz, slow):
    arguments = ("identify", "static", slow, *COLUMNS, "--time", "t", "--cutoff-hz", 2)
    printed = jointz(*arguments)
    quiet = jointz(*arguments, "--quiet")

    assert printed.code == quiet.code == 0
    assert "stiffness\t146" in printed.out
    assert (quiet.out, quiet.err) == ("", "")


def test_dither_json_holds_stiffness_and_damping_without_the_torque_of_the_inertia(jointz, fast):
    options = ("--inertia", f"{1e4 * INERTIA}:kg*cm^2", "--json")
    outcome = jointz("identify", "dither", fast, *DITHER, *options)

    assert outcome.code == 0
    found = outcome.json
    assert (found["model"], found["status"]) == ("dither", "ok")
    assert found["parameters"]["stiffness"]["value"] == pytest.approx(STIFFNESS, rel=0.01)
    assert found["parameters"]["damping"]["value"] == pytest.approx(DAMPING, rel=0.05)
    assert found["settings"]["inertia"] == pytest.approx(INERTIA)


@pytest.mark.parametrize(
    ("command", "more"), [("static", ("--rate", 100)), ("dither", DITHER[len(COLUMNS) :])]
)
def test_an_angle_that_stands_still_exits_1_with_the_code(jointz, fast, command, more):
    pd.read_csv(fast).assign(q=1.0).to_csv(fast, index=False)
    arguments = ("identify", command, fast, *COLUMNS, *more)
    outcome = jointz(*arguments, "--json")
    plain = jointz(*arguments)

    assert outcome.code == plain.code == 1
    assert outcome.json["model"] == command
    assert outcome.json["status"] == "failed:constant_angle"
    assert plain.err.startswith("jointz: ")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("static", *COLUMNS), "--rate"),
        (("static", *COLUMNS, "--rate", 100, "--direction", "t"), "direction"),
        (("static", *COLUMNS, "--rate", 100, "--direction", "absent"), "absent"),
        (("static", *COLUMNS, "--rate", 100, "--cutoff-hz", 80), "cutoff_hz"),
        (("static", *COLUMNS, "--rate", 100, "--figure", "fit.txt"), "--figure"),
        (("dither", *COLUMNS, "--rate", 500), "--frequency-hz"),
        (("dither", *DITHER, "--frequency-hz", 400), "frequency_hz"),
        (("dither", *DITHER, "--inertia", "heavy"), "--inertia"),
        (("dither", *DITHER, "--inertia", "-1"), "inertia"),
    ],
)
def test_what_cannot_be_used_exits_2(jointz, fast, arguments, word):
    command, *more = arguments
    outcome = jointz("identify", command, fast, *more)
    assert outcome.code == 2
    assert word in outcome.err
