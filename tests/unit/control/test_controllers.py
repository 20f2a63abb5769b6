"""Controllers: what they ask for along the mean stride, and what they refuse."""

import json

import numpy as np
import pytest

from jointz.control.profile_file import write_profile
from jointz.core.errors import ProtocolError
from jointz.core.protocols.protocol_models import ControllerSpec
from jointz.io.protocols import load_protocol
from jointz.rig.devices.interface import Wearer
from jointz.rig.experiment.controllers import (
    BUILT_IN,
    ControlState,
    make_controller,
    refuse_bad_controllers,
)

FOLLOWERS = sorted(set(BUILT_IN) - {"zero_torque"})
#: These give the moment of the profile along its own mean stride, at the nodes.
EXACT = ("torque_replay", "impedance_constant", "impedance_per_phase", "impedance_continuous")


@pytest.fixture(scope="module")
def protocol():
    return load_protocol("knee_controller")


@pytest.fixture
def file(profile, tmp_path):
    return write_profile(profile, tmp_path / "S01.json")


def made(name, protocol, *, profile=None, mass_kg=75.0, wearer="S01", **settings):
    spec = ControllerSpec(name=name, profile=profile and str(profile), settings=settings)
    return make_controller(spec, protocol=protocol, wearer=Wearer(wearer, mass_kg))


def torques(controller, gait_pct, angle, velocity, share=1.0):
    return np.array(
        [
            controller.torque(ControlState(0.0, phase, a, v, 0.0, 5), {"share": share})
            for phase, a, v in zip(gait_pct, angle, velocity, strict=True)
        ]
    )


@pytest.mark.parametrize("name", EXACT)
def test_moment_along_the_mean_stride(name, profile, file, protocol):
    controller = made(name, protocol, profile=file)
    along = profile.gait_pct, profile.angle, profile.velocity
    np.testing.assert_allclose(torques(controller, *along), profile.moment, atol=1e-9)
    part = torques(controller, *along, share=0.1)
    np.testing.assert_allclose(part, 0.1 * profile.moment, atol=1e-9)


def test_continuous_law_is_the_profiles_law(profile, file, protocol):
    rng = np.random.default_rng(0)
    state = rng.uniform(0.0, 100.0, 500), rng.uniform(-0.3, 1.5, 500), rng.normal(0.0, 5.0, 500)
    controller = made("impedance_continuous", protocol, profile=file)
    np.testing.assert_allclose(torques(controller, *state), profile.torque(*state), atol=1e-9)
    assert controller.torque(ControlState(0.0, 100.0, 0.2, 1.0, 0.0, 5), {"share": 1.0}) == (
        pytest.approx(float(profile.torque(0.0, 0.2, 1.0)))
    )


@pytest.mark.parametrize("name", ["impedance_constant", "impedance_per_phase", "kinematic_pd"])
def test_deviations_are_resisted(name, profile, file, protocol):
    controller = made(name, protocol, profile=file)
    off = np.full(100, 0.05)
    at = torques(controller, profile.gait_pct, profile.angle, profile.velocity)
    moved = torques(controller, profile.gait_pct, profile.angle + off, profile.velocity)
    faster = torques(controller, profile.gait_pct, profile.angle, profile.velocity + 1.0)
    assert (moved < at).all()
    assert (faster < at).all()
    if name == "impedance_constant":
        np.testing.assert_allclose((at - moved) / 0.05, profile.stiffness.mean())
        np.testing.assert_allclose(at - faster, profile.damping.mean())


def test_kinematic_pd_asks_nothing_along_the_mean_stride(profile, file, protocol):
    controller = made("kinematic_pd", protocol, profile=file, stiffness=30.0, damping=1.0)
    along = torques(controller, profile.gait_pct, profile.angle, profile.velocity)
    np.testing.assert_allclose(along, 0.0, atol=1e-9)


def test_quasi_stiffness_never_drives_the_knee_on(profile, file, protocol):
    tables = made("quasi_stiffness", protocol, profile=file).describe()["tables"]
    assert min(tables["stiffness_nm_rad"]) == 0.0
    assert max(tables["stiffness_nm_rad"]) > 0.0
    controller = made("quasi_stiffness", protocol, profile=file)
    asked = torques(controller, profile.gait_pct, profile.angle, profile.velocity)
    residual = np.std(asked - profile.moment)
    assert residual < np.std(profile.moment)


def test_four_states_published_and_fitted(file, protocol):
    published = made("four_state", protocol).describe()["tables"]
    assert published["stiffness_nm_rad"][10] == 99.372
    assert published["damping_nm_s_rad"][40] == 1.272
    fitted = made("four_state", protocol, profile=file).describe()["tables"]
    assert len(set(fitted["stiffness_nm_rad"])) == 4


def test_zero_torque(protocol):
    controller = made("zero_torque", protocol)
    assert controller.torque(ControlState(0.0, 20.0, 1.0, 3.0, 0.0, 5), {"share": 1.0}) == 0.0


@pytest.mark.parametrize("name", FOLLOWERS)
def test_description_is_json_that_holds_the_profile(name, file, protocol):
    about = made(name, protocol, profile=file).describe()
    assert json.loads(about["content"])["schema"] == "jointz.ImpedanceProfile/1"
    assert json.loads(json.dumps(about)) == about
    assert made(name, protocol, profile=file).parameters["share"].rate_per_s <= 0.1


def test_published_profile_is_scaled_to_the_wearer(protocol):
    heavy, light = (
        made("torque_replay", protocol, profile="published", mass_kg=kg).describe()["tables"]
        for kg in (90.0, 60.0)
    )
    np.testing.assert_allclose(heavy["feedforward_nm"], 1.5 * np.array(light["feedforward_nm"]))


def test_profile_of_the_participant(profile, tmp_path, protocol):
    write_profile(profile, tmp_path / "S07.json")
    place = f"{tmp_path}/{{participant}}.json"
    assert made("torque_replay", protocol, profile=place, wearer="S07").describe()["subject"]
    with pytest.raises(Exception, match=r"S08\.json"):
        made("torque_replay", protocol, profile=place, wearer="S08")


@pytest.mark.parametrize(
    ("change", "wearer", "text"),
    [
        ({"joint": "ankle"}, Wearer("S01", 75.0), "knee with positive flexion"),
        ({"positive": "extension"}, Wearer("S01", 75.0), "Signs are not turned"),
        ({}, Wearer("S01", 95.0), "weighs 95 kg"),
        ({}, Wearer("S01"), "mass of S01 is unknown"),
    ],
)
def test_another_joint_sign_or_mass_is_refused(change, wearer, text, file, protocol):
    condition = protocol.conditions[1].model_copy(
        update={"controller": ControllerSpec(name="torque_replay", profile=str(file))}
    )
    other = protocol.model_copy(update={"conditions": (condition,), **change})
    with pytest.raises(ProtocolError, match=text):
        refuse_bad_controllers(other, [wearer])


@pytest.mark.parametrize(
    ("name", "spec", "text"),
    [
        ("torque_replay", {}, "profile: missing"),
        ("zero_torque", {"profile": "published"}, "Remove it"),
        ("torque_replay", {"profile": "published", "settings": {"gain": 1.0}}, r"settings\.gain"),
        ("torque_replay", {"profile": "published", "settings": {"share": 1.5}}, "0 to 1, got 1.5"),
        ("kinematic_pd", {"profile": "published", "settings": {"damping": -1.0}}, "0 to 10"),
    ],
)
def test_settings_are_checked(name, spec, text, protocol):
    condition = protocol.conditions[1].model_copy(
        update={"controller": ControllerSpec(name=name, **spec)}
    )
    other = protocol.model_copy(update={"conditions": (condition,)})
    with pytest.raises(ProtocolError, match=text):
        refuse_bad_controllers(other, [Wearer("S01", 75.0)])
