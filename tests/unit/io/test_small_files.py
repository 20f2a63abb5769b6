"""Damaged and special files: clear errors, never another exception or a hang."""

import copy
import json
import os
import random
import tomllib

import pytest

from jointz.control.make_profile import impedance_profile
from jointz.control.profile_file import _sha256, profile_text, read_profile
from jointz.core.errors import DataError, DeviceFileError
from jointz.io.calibration_file import read_calibration
from jointz.io.protocols import load_protocol, protocol_text
from jointz.io.small_files import file_content, parse_toml, read_json
from jointz.rig.session.pulse_drawing import drawn_pulses
from jointz.rig.session.rigs.hardware_rig import read_device_file

MUTANTS = 200
VALUES = (
    *({}, [], None, "text", "", "nan", 1e300, 1e-300, -1, 0, True, float("nan"), float("inf")),
    *(10**400, 2**70, [[1.0]], [[[[]]]], [{}], [None], {"a": {}}),
)
CALIBRATION = {
    "jointz_calibration": 1,
    "calibration": {"torque_lag_s": {"value": 0.01, "sd": 0.001}},
    "participants": [{"id": "S01", "calibration": {"angle_gain": {"value": 1.0, "sd": 0.1}}}],
}


def signed(content):
    own = {key: value for key, value in content.items() if key != "sha256"}
    return json.dumps({**own, "sha256": _sha256(own)})


def toml(value):
    if isinstance(value, dict):
        return f"{{{', '.join(f'{json.dumps(k)} = {toml(v)}' for k, v in value.items())}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return repr(value) if isinstance(value, float) else json.dumps(value)


def toml_file(content):
    return "\n".join(f"{json.dumps(key)} = {toml(value)}" for key, value in content.items())


def use_profile(file):
    profile = read_profile(file)
    assert profile_text(profile)
    assert profile.summary()
    if profile.scales_with_mass:
        profile.for_mass(70.0)


def use_protocol(file):
    list(drawn_pulses(load_protocol(file)))


def plan():
    content = tomllib.loads(protocol_text("walking_doublets"))
    content["expected_joint"] = {"stiffness": 80.0, "damping": 1.0, "inertia": 0.3}
    content["planned_half_width_pct"] = {"stiffness": {"ISW": 20.0}}
    return content


FILES = {
    "profile": (use_profile, signed, lambda: json.loads(profile_text(impedance_profile()))),
    "plan": (use_protocol, toml_file, plan),
    "protocol": (use_protocol, toml_file, lambda: tomllib.loads(protocol_text("sea-bandwidth"))),
    "calibration": (read_calibration, toml_file, lambda: CALIBRATION),
}


def places(value, at=()):
    if at:
        yield at
    inside = value.items() if isinstance(value, dict) else ()
    for key, entry in enumerate(value) if isinstance(value, list) else inside:
        yield from places(entry, (*at, key))


def changed(content, rng):
    """Return the content with one value replaced, deleted or doubled."""
    content = copy.deepcopy(content)
    every = list(places(content))
    head = rng.choice(sorted({place[0] for place in every}))
    place = rng.choice([p for p in every if p[0] == head])
    inside = content
    for key in place[:-1]:
        inside = inside[key]
    way = rng.random()
    if way < 0.15:
        del inside[place[-1]]
    elif way < 0.25 and isinstance(inside, list):
        inside.append(inside[place[-1]])
    else:
        inside[place[-1]] = copy.deepcopy(rng.choice(VALUES))
    return content


def damaged(text, rng):
    """Return the text cut off, with random bytes, or with a part twice."""
    content, at, way = text.encode(), rng.randrange(len(text)), rng.random()
    if way < 0.4:
        return content[:at]
    if way < 0.7:
        return content[:at] + rng.randbytes(4) + content[at + 4 :]
    return content[: at + 40] + content[at:]


@pytest.mark.parametrize("kind", FILES)
def test_damaged_files_are_read_or_refused(tmp_path, kind):
    read, written, make = FILES[kind]
    rng, content, file = random.Random(37), make(), tmp_path / kind
    text = written(content)
    file.write_text(text)
    read(file)
    refused = 0
    for _ in range(MUTANTS):
        whole = rng.random() < 0.8
        mutant = written(changed(content, rng)).encode() if whole else damaged(text, rng)
        file.write_bytes(mutant)
        try:
            read(file)
        except DataError:
            refused += 1
    assert refused > MUTANTS // 2


@pytest.mark.parametrize("key", ["stiffness", "damping", "inertia"])
def test_an_impossible_joint_is_refused(tmp_path, key):
    content, file = plan(), tmp_path / "plan.toml"
    content["expected_joint"][key] = 1e300
    file.write_text(toml_file(content))
    with pytest.raises(DataError, match=rf"expected_joint\.{key}: expected less than or equal to"):
        load_protocol(file)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
@pytest.mark.parametrize("read", [read_profile, load_protocol, read_calibration, read_device_file])
def test_devices_pipes_and_folders_are_refused_at_once(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    for file, told in ((tmp_path / "pipe", "a named pipe"), ("/dev/zero", "a device")):
        with pytest.raises(DataError, match=f"is {told}; expected a file"):
            read(file)
    with pytest.raises(DataError):
        read(tmp_path)


@pytest.mark.parametrize(
    "text", ["[]", "NaN", '{"a": NaN}', '{"a": 1e400}', f'{{"a": {2**64}}}', "[" * 100_000, "\xff"]
)
def test_json_without_an_object_of_finite_numbers_is_refused(tmp_path, text):
    file = tmp_path / "file.json"
    file.write_text(text, encoding="latin-1")
    with pytest.raises(DataError, match=r"file\.json: cannot be read .*Make it again\."):
        read_json(file, "Make it again.")


def test_large_files_are_refused(tmp_path):
    file = tmp_path / "file.toml"
    file.write_bytes(b" " * 1001)
    with pytest.raises(DataError, match=r"larger than 0\.001 MB"):
        file_content(file, absent="", largest=1000)
    assert len(file_content(file, absent="", largest=1001)) == 1001


def test_deep_toml_is_refused():
    with pytest.raises(DeviceFileError, match="not valid TOML"):
        parse_toml("here", b"a = " + b"[" * 100_000, error=DeviceFileError)
