"""Known additions from the protocol to the study, its truth, and a run that was interrupted."""

import json
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

import jointz
from jointz.core.errors import DataError
from jointz.core.study import CalibrationSpec, StudySpec
from jointz.io.protocols import load_protocol
from jointz.rig.devices.interface import Wearer
from jointz.rig.session.rigs.rig_settings import open_rig, rig_settings
from jointz.rig.session.study_file import study_toml

EXAMPLE = Path(__file__).parents[4] / "examples" / "known_addition" / "walking_known_addition.toml"
WITH_CUFF = ("unperturbed_2", "perturbed_2", "perturbed_3")
WITH_BAND = ("unperturbed_band", "perturbed_band")


def run(out, protocol=EXAMPLE, **arguments):
    return jointz.run(protocol, out=out, seed=1, preset="nominal", **arguments)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """Return the study of a run that stopped in the middle of a condition with a load."""
    out = tmp_path_factory.mktemp("known") / "study"

    def stop(participant, condition, strides, done, planned):
        if condition == "perturbed_2" and done >= 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(out, progress=stop)
    return out


@pytest.fixture(scope="module")
def study(interrupted):
    return run(interrupted, resume=True).study


def test_another_load_is_another_run(study):
    protocol = load_protocol(EXAMPLE)
    cuff, band = protocol.loads
    heavier = cuff.model_copy(update={"mass_kg": cuff.mass_kg.model_copy(update={"value": 3.0})})

    with pytest.raises(DataError, match="protocol_sha256"):
        run(study, protocol.model_copy(update={"loads": (heavier, band)}), resume=True)


def test_the_study_states_the_addition_of_every_session(study):
    spec = jointz.open_study(study).spec
    by_session = {addition.session: addition for addition in spec.additions}

    assert set(by_session) == {"with", "with_again", "band"}
    assert by_session["with_again"].inertia == by_session["with"].inertia
    assert by_session["with"].inertia.value == pytest.approx(2.0 * 0.25**2)
    assert by_session["with"].gravity_nm.value == pytest.approx(2.0 * 9.81 * 0.25)
    assert by_session["with"].stiffness is None
    assert by_session["band"].stiffness.value == 30.0
    assert [r.session for r in spec.recordings] == [
        "without", "without", "with", "with", "with_again", "band", "band", "without_again",
    ]  # fmt: skip


def test_the_truth_has_the_same_true_load_in_every_condition_of_it(study):
    truth = json.loads((study / "ground_truth.json").read_text("utf-8"))["participants"]["S01"]
    loads = {name: values["load"] for name, values in truth.items() if "load" in values}

    assert set(loads) == {*WITH_CUFF, *WITH_BAND}
    for names, key, stated in ((WITH_CUFF, "mass_kg", 2.0), (WITH_BAND, "stiffness", 30.0)):
        true = {loads[name][key] for name in names}
        assert len(true) == 1
        assert true.pop() == pytest.approx(stated, rel=0.1)


def test_every_condition_is_opened_with_its_own_load():
    rig = open_rig(rig_settings(load_protocol(EXAMPLE), "sim", "clean", 1), 0)

    inertia = {name: rig.build(worn=True, condition=name).curves[0, 8] for name in WITH_CUFF}
    own = rig.build(worn=True, condition="perturbed_1").curves[0, 8]
    assert [J - own for J in inertia.values()] == pytest.approx([2.0 * 0.25**2] * 3)


def test_a_session_without_a_name_is_called_after_its_condition():
    protocol = load_protocol(EXAMPLE)
    nameless = tuple(c.model_copy(update={"session": None}) for c in protocol.conditions)
    protocol = protocol.model_copy(update={"conditions": nameless})
    rig = SimpleNamespace(wearer=Wearer("S01"), device=None)
    text = study_toml(protocol, [rig], [CalibrationSpec()], None)
    spec = StudySpec.model_validate(tomllib.loads(text))

    assert [addition.session for addition in spec.additions] == [*WITH_CUFF, *WITH_BAND]
