"""What the files decide is drafted, and what they do not decide is asked."""

import tomllib

import numpy as np
import pandas as pd
import pytest

from jointz.inspection.inspect_file import inspect_file

RATE_HZ = 500.0
TIME_S = np.arange(0.0, 60.0, 1 / RATE_HZ)
#: A knee over a stride, deg.
KNEE = (4, 8, 13, 16, 18, 18, 16, 13, 10, 8, 6, 5, 5, 6, 9, 14, 22, 32, 43, 52, 58, 60, 58, 52, 43,
        32, 20, 10, 4, 1, 0, 2)  # fmt: skip
STRIDE_S = 1.1


def gait(time_s=TIME_S):
    """The knee of a walking person, deg."""
    phase = (time_s / STRIDE_S) % 1 * len(KNEE)
    return np.interp(phase, range(len(KNEE) + 1), (*KNEE, KNEE[0]))


def pulses(every_s=2.3):
    """A command of 10 N*m for 0.1 s, in both directions."""
    sign = np.where(TIME_S // every_s % 2, 10.0, -10.0)
    return sign * (TIME_S % every_s < 0.1) * (every_s < TIME_S)


def moved(torque, inertia=0.3):
    """The motion by a torque of a joint with damping and stiffness, deg."""
    angle, speed = np.zeros(torque.size), 0.0
    for k in range(1, torque.size):
        speed += (torque[k] - 2.0 * speed - 40.0 * angle[k - 1]) / inertia / RATE_HZ
        angle[k] = angle[k - 1] + speed / RATE_HZ
    return np.rad2deg(angle)


def noise(sd, seed=0):
    return np.random.default_rng(seed).normal(0.0, sd, TIME_S.size)


def random_signal(sd):
    """A smooth random signal."""
    white = noise(1.0, 5)
    smooth = np.convolve(np.convolve(white, np.ones(40), "same"), np.ones(40), "same")
    return sd * smooth / smooth.std()


def draft(folder, name="S01.csv", **columns):
    """Inspect a file of columns, and return the draft and what is open in it."""
    table = {"time_s": TIME_S, **columns}
    pd.DataFrame(table).round(6).to_csv(folder / name, index=False)
    found = inspect_file(folder if any(folder.glob("*pulses.csv")) else folder / name)
    return tomllib.loads(found.toml), [q.about for q in found.questions if not q.drafted]


def test_a_gait_without_a_contact_is_walking(tmp_path):
    study, asked = draft(tmp_path, knee_deg=gait() + noise(0.1), torque_Nm=noise(1.0))

    assert study["kind"] == "walking"
    assert "kind" not in asked


@pytest.mark.parametrize("period_s", [0.8, 1.5])
def test_a_sine_may_be_of_a_bench_or_of_walking(tmp_path, period_s):
    sine = 30 * np.sin(2 * np.pi * TIME_S / period_s) + noise(0.1)

    study, asked = draft(tmp_path, knee_deg=sine, torque_Nm=noise(1.0))

    assert study["kind"] == "?"
    assert "kind" in asked


@pytest.mark.parametrize("every_s", [1.5, 2.3])
def test_regular_pulses_of_a_limb_at_rest_are_no_gait(tmp_path, every_s):
    torque = pulses(every_s)
    angle = moved(torque) + noise(0.01)

    study, asked = draft(tmp_path, knee_deg=angle, torque_Nm=torque + noise(0.1), command_Nm=torque)

    assert study["kind"] == "bench"
    assert not {"kind", "recordings.condition"} & set(asked)


@pytest.mark.parametrize("name", ["u", "DAC0", "ref", "Analog 3", "torque_cmd"])
@pytest.mark.parametrize("walking", [True, False])
def test_a_column_that_the_torque_follows_is_the_command(tmp_path, name, walking):
    command = pulses()
    angle = walking * gait() + moved(command) + noise(0.01)
    torque = command + walking * 5 * np.sin(2 * np.pi * TIME_S / STRIDE_S) + noise(0.1)

    study, asked = draft(tmp_path, **{"knee_deg": angle, "torque_Nm": torque, name: command})

    assert study["channels"]["command"]["column"] == name
    assert study["channels"]["command"]["unit"] == "N*m"
    assert study["recordings"][0]["condition"] == "perturbed"
    assert study["torque_acts_on"] == "joint"
    assert walking is False or asked == ["channels.heel_strikes.column"]


def test_a_command_in_another_unit_is_asked_for_it(tmp_path):
    command = pulses()
    columns = {"knee_deg": moved(command), "torque_Nm": command + noise(0.1), "u": 0.2 * command}

    assert "channels.command.unit" in draft(tmp_path, **columns)[1]


def test_marks_of_strides_are_no_command(tmp_path):
    mark = 1.0 * (TIME_S % STRIDE_S < 0.05)
    torque = 10 * np.cos(2 * np.pi * TIME_S / STRIDE_S) + noise(0.1)

    study, asked = draft(tmp_path, knee_deg=gait(), torque_Nm=torque, M1=mark)

    assert "command" not in study["channels"]
    assert "recordings.condition" in asked


def test_a_random_torque_is_not_taken_as_unperturbed(tmp_path):
    torque = random_signal(3.0)

    study, asked = draft(tmp_path, knee_deg=moved(torque), torque_Nm=torque, command_Nm=torque)

    assert study["recordings"][0]["condition"] == "?"
    assert "recordings.condition" in asked


def test_a_random_position_has_no_steps(tmp_path):
    study, asked = draft(tmp_path, knee_deg=random_signal(3.0), torque_Nm=random_signal(2.0))

    assert "source" not in study.get("perturbations", {})
    assert "recordings.condition" in asked


def test_levels_without_a_meaning_are_asked(tmp_path):
    half = np.where(TIME_S < 30, "A", "baseline")

    study, asked = draft(tmp_path, knee_deg=gait(), torque_Nm=noise(1.0), condition=half)

    assert study["channels"]["condition"]["values"] == {"A": "?", "baseline": "unperturbed"}
    assert "channels.condition.values" in asked


def test_pulses_of_the_command_say_what_a_level_means(tmp_path):
    torque = pulses() * (TIME_S < 30)
    level = np.where(TIME_S < 30, 2, 1)
    columns = {"knee_deg": moved(torque), "torque_Nm": torque + noise(0.1), "command_Nm": torque}

    study, _ = draft(tmp_path, **columns, condition=level)

    assert study["channels"]["condition"]["values"] == {"1": "unperturbed", "2": "perturbed"}


@pytest.mark.parametrize(("size", "unit"), [(1.0, ""), (1000.0, "mN*m"), (100.0, "N*cm")])
def test_an_impossible_inertia_doubts_the_unit_of_torque(tmp_path, size, unit):
    torque = pulses()
    onsets = TIME_S[1:][(torque[1:] != 0) & (torque[:-1] == 0)]
    pd.DataFrame({"onset_s": onsets}).to_csv(tmp_path / "S01_pulses.csv", index=False)
    columns = {"knee_deg": moved(torque) + noise(0.005), "torque_Nm": size * (torque + noise(0.1))}

    _, asked = draft(tmp_path, "S01_perturbed.csv", **columns)

    assert ("channels.torque.unit" in asked) is bool(unit)


def test_a_small_angle_on_a_bench_may_be_in_degrees(tmp_path):
    torque = pulses()

    _, asked = draft(
        tmp_path, knee_angle=0.1 * moved(torque), torque_Nm=torque + noise(0.1), command_Nm=torque
    )

    assert "channels.angle.unit" in asked


@pytest.mark.parametrize(
    ("angle", "direction", "zero"),
    [(5 - gait(), "extension", None), (180 - gait(), "extension", -np.pi),
     (180 + gait(), "flexion", np.pi), (gait() - 5, "flexion", None)],
)  # fmt: skip
def test_the_range_of_a_walking_knee_tells_its_direction(tmp_path, angle, direction, zero):
    study, asked = draft(tmp_path, knee_deg=angle, torque_Nm=noise(1.0))

    assert study["channels"]["angle"].get("positive", "flexion") == direction
    found = study.get("calibration", {}).get("angle_zero_rad", {}).get("value")
    assert found == (None if zero is None else pytest.approx(zero, abs=1e-5))
    assert "channels.angle.positive" not in asked


@pytest.mark.parametrize(("leg", "is_open"), [("right", False), ("left", True)])
def test_the_leg_that_pulses_move_is_the_one_of_the_device(tmp_path, leg, is_open):
    command = pulses()
    angles = {"right": gait() + noise(0.01), "left": gait(TIME_S + STRIDE_S / 2) + noise(0.01, 1)}
    angles[leg] += moved(command)
    columns = {f"knee_angle_{side}_deg": angle for side, angle in angles.items()}

    _, asked = draft(tmp_path, **columns, torque_Nm=command + noise(0.1), command_Nm=command)

    assert ("recordings.side" in asked) is is_open


def test_constants_and_covariances_are_no_signals(tmp_path):
    angle = gait() + noise(0.1)
    columns = {"knee_angle_0": 12.5, "cov_knee_angle": noise(1.0), "knee_q": angle}

    study, _ = draft(tmp_path, **columns, torque_Nm=noise(1.0))

    assert study["channels"]["angle"]["column"] == "knee_q"


def test_short_names_tell_the_joint(tmp_path):
    study, _ = draft(tmp_path, ank_angle=gait(), ank_torque_Nm=noise(1.0))

    assert study["joint"] == "ankle"
