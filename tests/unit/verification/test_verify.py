"""A known addition to the joint, as pulses without and with it show it."""

import json

import numpy as np
import pytest

import jointz as jz
from jointz.core.errors import DataError
from jointz.core.protocols.protocol import Protocol
from jointz.core.study import AdditionSpec
from jointz.identify.walking.addition import felt_inertia
from jointz.io.protocols import load_protocol
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.walking.impedance_curves import added_inertia, thigh_share
from jointz.rig.sim.walking.knee_joint import knee_angle
from jointz.rig.sim.walking.known_addition import KnownAddition
from jointz.verification.verify import AdditionResult, Verification

SENSORS = {"goniometer": None, "encoder": None, "gyroscopes": None}


def protocol():
    """Return the built-in protocol at three timing points, each state walked once."""
    raw = load_protocol("verify").model_dump(exclude_unset=True, mode="json")
    raw["conditions"] = raw["conditions"][:4]
    for condition in raw["conditions"]:
        if "perturbations" in condition:
            condition["perturbations"]["timing_points"] = {"MST": 21.5, "TST": 40.5, "ISW": 68.5}
            condition["perturbations"]["count_per_point"] = 24
    return Protocol.model_validate(raw)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("verify") / "study"
    jz.run(protocol(), out=folder, seed=2, preset="realistic", progress=False)
    return folder


@pytest.fixture(scope="module")
def found(study):
    return jz.verify(study)


def test_the_band_that_was_mounted_is_found(study, found):
    truth = json.loads((study / "ground_truth.json").read_text())["participants"]["S01"]
    mounted = truth["perturbed_2"]["load"]["stiffness"]
    stiffness, inertia = found.parts
    assert (stiffness.part, inertia.part) == ("stiffness", "inertia")
    assert stiffness.ci_low < mounted < stiffness.ci_high
    assert inertia.ci_low < 0.0 < inertia.ci_high
    assert stiffness.verdict == "pass"
    assert found.verdicts == {"S01": "pass"}
    assert found.explanations == {}


def test_the_result_is_a_table_a_text_and_a_figure(found, tmp_path):
    frame = found.to_frame()
    assert frame["stated"].tolist() == [50.0, 0.0]
    assert "S01: pass" in found.summary()
    assert "stated 50: pass" in found.summary()
    assert found.plot().get_ylabel() == "Found, % of the addition"
    assert Verification.from_dict(found.to_dict()) == found


def test_a_wrong_gain_of_the_torque_fails_and_is_named(jointz, study, changed):
    (line,) = [
        x for x in (study / "study.toml").read_text().splitlines() if x.startswith("torque_const")
    ]
    wrong = f"torque_constant = {2.0 * float(line.partition('=')[2]):g}"
    copy = changed(line, wrong)

    result = jointz("verify", copy, "--json")

    told = json.loads(result.out)
    assert result.code == 1
    assert told["status"] == "fail"
    assert told["verdicts"] == {"S01": "fail"}
    assert "torque gain" in told["explanations"]["S01"]


def test_an_addition_of_another_size_fails(changed):
    copy = changed("stiffness = { value = 50.0", "stiffness = { value = 110.0")
    assert jz.verify(copy).verdicts == {"S01": "fail"}


def test_files_are_written_by_the_command(jointz, study, tmp_path):
    table, figure = tmp_path / "v.csv", tmp_path / "v.svg"
    result = jointz("verify", study, "--out", table, "--figure", figure)
    assert result.code == 0
    assert table.read_text().startswith("participant,part,stated")
    assert "<svg" in figure.read_text()


def test_a_study_without_additions_is_refused(study, changed):
    text = (study / "study.toml").read_text()
    at = text.index("[[additions]]")
    copy = changed(text[at : text.index("[[recordings]]", at)], "")
    with pytest.raises(DataError, match=r"expected \[\[additions\]\]"):
        jz.verify(copy)


def test_pulses_with_and_without_it_are_needed(study, changed):
    text = (study / "study.toml").read_text()
    both = text[text.index("[[additions]]") : text.index("[[recordings]]")]
    more = both.replace('"with"', '"without"')
    with pytest.raises(DataError, match="pulses without and with the addition"):
        jz.verify(changed(both, both + more))


def test_the_plan_says_how_well_it_will_be_told(found):
    plan = jz.plan(protocol(), sensors=SENSORS)
    (note,) = [note for note in plan.notes if note.startswith("jointz verify estimates band")]
    percent = float(note.partition("±")[2].partition(" %")[0])
    stiffness = found.parts[0]
    reached = 50.0 * (stiffness.ci_high - stiffness.ci_low) / stiffness.stated
    assert 0.4 * reached < percent < 2.5 * reached


@pytest.mark.parametrize("weight", [True, False])
def test_the_inertia_that_is_felt_is_that_of_the_simulated_leg(weight):
    """Two derivations: energy of the leg's motion here, two links in the simulation."""
    person, settings = draw_person(0, seed=5), preset("realistic")
    kind = {"mass_kg": 0.2, "distance_m": 0.30} if weight else {}
    inertia = 0.2 * 0.30**2
    load = KnownAddition("x", inertia=inertia, gravity_nm=0.2 * 9.81 * 0.30 * weight, **kind)
    stated = AdditionSpec(
        session="with",
        inertia={"value": inertia, "sd": 0.0},
        **({"gravity_nm": {"value": load.gravity_nm, "sd": 0.0}} if weight else {}),
    )
    phases = np.array([0.1, 0.3, 0.7, 0.8])
    share = 1.0 - thigh_share(person, settings, phases)
    expected = added_inertia(person, settings, load, phases)
    knee = knee_angle(phases)
    felt = [
        inertia * np.polyval(felt_inertia(stated, 100.0 * p, k, person.height_m)[::-1], s)
        for p, k, s in zip(phases, knee, share, strict=True)
    ]
    assert felt == pytest.approx(expected, rel=0.15, abs=0.06 * inertia)


def test_the_mean_stiffness_of_three_legs_is_judged(study, monkeypatch, changed):
    text = (study / "study.toml").read_text()
    start, end = text.index("[[participants]]"), text.index("[[additions]]")
    person = text[start:end]
    everybody = "".join(person.replace("S01", name) for name in ("S01", "S02", "S03"))
    found = {"S01": 56.0, "S02": 58.0, "S03": 57.0}

    def leg(study, addition, person, side):
        value = found[person]
        parts = (
            AdditionResult(
                person, "stiffness", 50.0, 1.0, value, value - 9, value + 9, "pass", 1.0
            ),
            AdditionResult(person, "inertia", 0.0, 0.0, 0.0, -0.1, 0.1, "pass", None),
        )
        return Verification(parts, {person: "pass"}, {person: 0.3}, {})

    monkeypatch.setattr("jointz.verification.verify._verified", leg)
    monkeypatch.setattr("jointz.verification.verify._sides", lambda *_: [""])
    result = jz.verify(changed(person, everybody))

    mean = result.parts[-1]
    assert (mean.participant, mean.part, mean.found) == ("mean of legs", "stiffness", 57.0)
    assert mean.ci_high - 57.0 == pytest.approx(4.303 / 3**0.5, rel=1e-3)  # t of 2 degrees, sd 1
    assert result.verdicts == dict.fromkeys(found, "pass") | {"mean of legs": "fail"}
    assert result.verdict == "fail"
