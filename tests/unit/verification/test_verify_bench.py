"""Known loads of a bench, as its pulses show them."""

import pytest

import jointz as jz
from jointz.core.protocols.protocol import Protocol
from jointz.io.protocols import load_protocol
from jointz.verification.verify import Verification


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return a bench study of one load: spring, damper and inertia."""
    raw = load_protocol("sea-mass-spring").model_dump(exclude_unset=True, mode="json")
    raw["loads"] = [load for load in raw["loads"] if load["name"] == "damper"]
    raw["conditions"] = [one for one in raw["conditions"] if one["session"] == "A"]
    for condition in raw["conditions"]:
        condition["trials"] = 2
    folder = tmp_path_factory.mktemp("bench") / "study"
    jz.run(Protocol.model_validate(raw), out=folder, seed=1, progress=False)
    return folder


def test_a_load_as_stated_passes(study):
    found = jz.verify(study)
    assert found.verdicts == {"damper, A": "pass"}
    assert [(row.part, row.stated) for row in found.parts] == [
        ("stiffness", 168.0),
        ("damping", 0.5),
        ("inertia", 0.0364),
    ]
    assert "damping: 0.4" in found.summary()
    assert len(found.plot().get_legend().get_texts()) == 3


def test_a_wrong_gain_of_the_torque_fails_and_is_named(changed):
    wrong = changed("[channels.torque]", "[channels.torque]\nscale = 1.15")
    found = jz.verify(wrong)
    assert found.verdicts == {"damper, A": "fail"}
    assert "torque over angle 1.1" in found.explanations["damper, A"]


def test_a_load_of_another_inertia_fails_without_a_gain_that_explains_it(changed):
    wrong = changed(
        "inertia = { value = 0.0364, sd = 4.97e-05 }", "inertia = { value = 0.05, sd = 0.0 }"
    )
    found = jz.verify(wrong)
    verdicts = {row.part: row.verdict for row in found.parts}
    assert verdicts == {"stiffness": "pass", "damping": "pass", "inertia": "fail"}
    assert "no single error" in found.explanations["damper, A"]


def test_what_the_pulses_do_not_decide_cannot_be_told(changed):
    stated = "damping = { value = 0.5, sd = 0.01 }"
    found = jz.verify(changed(stated, "damping = { value = 0.5, sd = 0.4 }"))
    assert found.verdicts == {"damper, A": "cannot tell"}
    assert "its SD as stated is too wide" in found.summary()


def test_time_stamps_that_run_fast_fail_and_are_named(changed):
    found = jz.verify(changed("[channels.time]", "[channels.time]\nscale = 1.08"))
    assert found.verdicts == {"damper, A": "fail"}
    assert "time between samples 1.0" in found.explanations["damper, A"]


def test_a_torque_of_the_wrong_sign_fails_without_an_estimate(changed, tmp_path):
    wrong = changed("[channels.torque]", "[channels.torque]\nscale = -1.0")
    found = jz.verify(wrong)
    assert found.verdicts == {"damper, A": "fail"}
    assert "stiffness: no estimate, stated 168 N*m/rad: fail" in found.summary()
    assert "below zero" in found.explanations["damper, A"]
    assert Verification.from_dict(found.to_dict()) == found
    found.plot()


def test_a_bench_states_loads_of_participants(jointz, changed):
    wrong = changed('[[additions]]\nparticipant = "damper"', '[[additions]]\nsession = "A"')
    result = jointz("verify", wrong)
    assert result.code == 2
    assert "session: not for kind 'bench'" in result.err


def test_a_load_that_was_not_measured_is_refused(jointz, changed):
    wrong = changed(
        '[[additions]]\nparticipant = "damper"', '[[additions]]\nparticipant = "spring"'
    )
    result = jointz("verify", wrong)
    assert result.code == 2
    assert "no recording has participant 'spring'" in result.err
