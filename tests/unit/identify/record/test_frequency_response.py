from functools import partial

import numpy as np
import pandas as pd
import pytest
from tests.unit.identify.record.steady_joint import KBJ, RATE, make_record

from jointz.core.errors import DataError, EstimationError
from jointz.identify.record.joint import identify_joint

identify_frf = partial(identify_joint, model="frf")


def relative_error(fit) -> np.ndarray:
    return np.array([p.value for p in fit.parameters]) / KBJ - 1.0


@pytest.mark.parametrize("perturbed", ["torque", "angle"])
def test_the_curve_and_k_b_j_are_the_joint_s(perturbed):
    fit = identify_frf(**make_record(perturbed), rate_hz=RATE, input=perturbed)

    table = fit.response.table()
    s = 2j * np.pi * table["frequency_hz"].to_numpy()
    true = KBJ @ np.stack([np.ones_like(s), s, s**2])
    slow = table["frequency_hz"] < 15.0
    gain, phase = table.loc[slow, ["gain", "phase_rad"]].to_numpy().T
    assert gain == pytest.approx(np.abs(true)[slow], rel=0.05)
    assert phase == pytest.approx(np.angle(true)[slow], abs=0.05)
    assert np.all(np.abs(relative_error(fit)) < 0.01)
    assert fit.warnings == ()
    assert fit.vaf_of == ("angle" if perturbed == "torque" else "torque")
    assert fit.status == "ok"


@pytest.mark.parametrize("perturbed", ["torque", "angle"])
def test_the_band_of_the_curve_holds_the_truth(perturbed):
    inside = []
    for seed in range(8):
        record = make_record(perturbed, seed=seed, muscle=1.0)
        fit = identify_frf(**record, rate_hz=RATE, input=perturbed, cutoff_hz=15.0)
        table = fit.response.table()
        s = 2j * np.pi * table["frequency_hz"].to_numpy()
        true = np.abs(KBJ @ np.stack([np.ones_like(s), s, s**2]))
        inside.append(np.mean((table["gain_low"] < true) & (true < table["gain_high"])))

    assert 0.85 < np.mean(inside) <= 1.0


@pytest.mark.parametrize(("true", "wrong"), [("torque", "angle"), ("angle", "torque")])
def test_with_torque_inside_the_joint_the_wrong_direction_is_warned_about(true, wrong):
    record = make_record(true, muscle=1.0)

    right = identify_frf(**record, rate_hz=RATE, input=true)
    other = identify_frf(**record, rate_hz=RATE, input=wrong)

    assert np.all(np.abs(relative_error(right)) < 0.015)
    assert right.warnings == ()
    assert any(f"the record looks {true}-perturbed" in w for w in other.warnings)
    gain = {fit.input: fit.response.table()["gain"][:2].mean() for fit in (right, other)}
    assert gain[true] == pytest.approx(80.0, rel=0.3)
    assert abs(gain[wrong] / gain[true] - 1.0) > 0.1  # (1.2) itself reads muscle as response


def test_a_command_is_the_instrument_where_the_torque_was_perturbed():
    record = make_record()
    command = np.roll(record["torque"], 5)

    fit = identify_frf(**record, command=command, rate_hz=RATE)

    assert fit.settings["instrument"] == "command"
    assert np.all(np.abs(relative_error(fit)) < 0.01)
    assert fit.response.gain[0] == pytest.approx(80.0, rel=0.05)


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "stiffness"), [("z_df", 105), ("z_pf", 107), ("z_df3", 160)])
def test_a_real_ankle_has_the_stiffness_of_regression_in_time(real_data, name, stiffness):
    record = pd.read_csv(real_data / "reklab_ankle" / f"{name}.csv.gz")

    fit = identify_frf(
        angle=record["position_rad"],
        torque=record["torque_Nm"],
        time=record["time_s"],
        input="angle",
        torque_acts_on="device",
    )

    assert fit.parameter("stiffness").unbounded == pytest.approx(stiffness, rel=0.05)
    assert fit.check.finding == "reflex"


def test_angle_and_torque_of_two_records_are_not_coherent():
    record = make_record() | {"angle": 0.1 * np.random.default_rng(9).standard_normal(12_000)}

    with pytest.raises(EstimationError) as caught:
        identify_frf(**record, rate_hz=RATE)

    assert caught.value.code == "not_coherent"


def test_a_band_of_few_frequencies_is_refused():
    record = {name: x[:1000] for name, x in make_record().items()}
    with pytest.raises(DataError, match="12 frequencies"):
        identify_frf(**record, rate_hz=RATE, cutoff_hz=3.0)
