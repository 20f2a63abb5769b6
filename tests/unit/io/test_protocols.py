"""Protocols that come with jointz, and the user's own."""

import contextlib
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jointz.core.errors import DataError, ProtocolError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.io.protocols import builtin_protocols, load_protocol, protocol_text


@pytest.fixture
def own(tmp_path):
    """Write the text of ``walking``, changed, to a file."""

    def write(*changes):
        text = protocol_text("walking")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        file = tmp_path / "own.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


@pytest.mark.parametrize("name", builtin_protocols())
def test_a_built_in_protocol_bears_its_name_and_states_section_and_notes(name):
    made = load_protocol(name)

    assert made.name == name
    assert made.title == builtin_protocols()[name]
    # Some are not of the dissertation.
    assert made.section or name in (
        "walking_doublets",
        "walking_random",
        "knee_controller",
        "verify",
    )
    assert made.notes


def test_walking_is_the_experiment_of_chapter_four():
    made = load_protocol("walking")
    plan = made.conditions[2].perturbations

    assert (made.section, made.participants, made.gait.speed_m_s) == ("4.2", 10, 1.2)
    conditions = [(c.condition, c.strides) for c in made.conditions]
    assert conditions == [("no_device", 60), ("unperturbed", 60), ("perturbed", None)]
    assert plan.timing_points == dict(TIMING_POINTS)
    assert (plan.count_per_point, plan.gap_strides, plan.total) == (50, (3, 7), 300)
    form = {"duration_s": 0.25, "ramp_up_s": 0.0, "hold_s": 0.25, "ramp_down_s": 0.0}
    assert made.pulse.model_dump() == {"amplitude_nm": 17.0, "direction": "positive"} | form
    assert made.positive == "flexion"
    assert made.rates.control_hz == made.rates.sample_hz == 500.0


def test_three_hundred_pulses_take_twenty_seven_and_a_half_minutes():
    made = load_protocol("walking")

    without_pulses_s = (60 + 60 + 10) * 1.1
    assert made.expected_duration_s - without_pulses_s == pytest.approx(27.5 * 60)


def test_a_file_is_read_like_a_built_in_protocol(own):
    file = own()

    assert load_protocol(file) == load_protocol(str(file)) == load_protocol("walking")
    assert protocol_text(file) == protocol_text("walking")


def test_a_profile_is_looked_for_beside_its_protocol(tmp_path, monkeypatch):
    text = protocol_text("knee_controller")
    own_profile = 'profile = "profiles/{participant}.json"'
    text = text.replace('profile = "published"', own_profile, 1)
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    made = load_protocol("own.toml")

    profiles = [condition.controller.profile for condition in made.conditions]
    beside = str(tmp_path / "profiles" / "{participant}.json")
    assert profiles == [None, beside, "published", None]
    assert load_protocol(tmp_path / "own.toml") == made
    absolute = text.replace("profiles/{participant}.json", beside.replace("\\", "/"))
    (tmp_path / "own.toml").write_text(absolute, encoding="utf-8")
    assert load_protocol("own.toml").conditions == made.conditions


def test_every_problem_of_a_file_comes_in_one_error(own):
    file = own(
        ("gap_strides = [3, 7]", "gap_strides = [7, 3]"),
        ("MSW = 81.0", "MSW = 181.0"),
        ("hold_s = 0.25", "hold_s = 0.2\nholds_s = 0.2"),
        ('name = "perturbed"', 'name = "unperturbed"'),
        ("speed_m_s = 1.2", 'speed_m_s = "fast"'),
        ("control_hz = 500.0", "control_hz = 300.0"),
    )

    with pytest.raises(ProtocolError) as caught:
        load_protocol(file)

    assert caught.value.path == str(file)
    assert sorted(told.split(": ")[0] for told in caught.value.problems) == [
        "conditions",
        "conditions[3].perturbations.gap_strides",
        "conditions[3].perturbations.timing_points.MSW",
        "gait.speed_m_s",
        "pulse.duration_s",
        "pulse.holds_s",
        "rates.sample_hz",
    ]


@pytest.mark.parametrize("name", ["wallking", "nothing-like-it", "", "no\0name", os.curdir])
def test_a_protocol_that_is_not_there_is_told_with_those_that_are(name):
    for read in (load_protocol, protocol_text):
        with pytest.raises(DataError, match="walking"):
            read(name)


def test_a_file_that_may_not_be_read_is_told(own, monkeypatch):
    file = own()

    def refuse(path, mode):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(DataError, match=r"own\.toml: .*Permission denied"):
        load_protocol(file)


PULSE = '[[pulses]]\nname = "a"\nkind = "{}"\namplitudes_nm = [10.0]\n'
DOUBLET = PULSE.format("doublet") + "durations_s = [0.04, 0.02]\n"
TABLE = PULSE.format("samples") + "times_s = {}\nshares = {}\n"


@pytest.fixture
def with_pulses(tmp_path):
    """Write ``walking_doublets`` with other pulses to a file."""

    def write(pulses):
        text = protocol_text("walking_doublets")
        begin, end = text.index("[[pulses]]"), text.index("[expected_joint]")
        file = tmp_path / "pulses.toml"
        file.write_text(text[:begin] + pulses + text[end:])
        return file

    return write


@pytest.mark.parametrize(
    ("pulses", "keys"),
    [
        ("", {"pulse"}),
        ("[pulses]\n", {"pulses"}),
        (DOUBLET + "[pulse]\namplitude_nm = 5.0\nduration_s = 0.1\nhold_s = 0.1\n", {"pulses"}),
        ("".join(DOUBLET.replace('"a"', f'"a{k}"') for k in range(24)), {"pulses"}),
        (
            '[[pulses]]\nkind = "trapezoid"\nhold_s = 0.1\n',
            {"pulses[1].name", "pulses[1].amplitudes_nm"},
        ),
        (PULSE.format("triplet"), {"pulses[1].kind"}),
        (DOUBLET + "second_level = 1.0\n", {"pulses[1].second_level"}),
        (DOUBLET + "second_level = nan\n", {"pulses[1].second_level"}),
        (DOUBLET.replace("10.0", "1e300"), {"pulses[1].amplitudes_nm"}),
        (DOUBLET.replace("10.0", "7.0, 7.0"), {"pulses[1].amplitudes_nm"}),
        (DOUBLET.replace('"a"', '"a\\u001b[31m"'), {"pulses[1].name"}),
        (DOUBLET.replace('"a"', '"=1+1"'), {"pulses[1].name"}),
        (TABLE.format([0.0, 0.1, 0.05], [1, 0, 0]), {"pulses[1].times_s"}),
        (TABLE.format([0.0, 1e9, 0.05], [1, 0, 0]), {"pulses[1].times_s"}),
        (TABLE.format([-0.1, 0.1], [1, 0]), {"pulses[1].times_s[1]"}),
        (TABLE.format([0.0, 0.1, 0.2], [1, 0]), {"pulses[1].shares"}),
        (TABLE.format([0.0, 0.1], [0.0, 0.0]), {"pulses[1].shares"}),
        (TABLE.format([0.0] * 1001, [1.0] * 1001), {"pulses[1].times_s", "pulses[1].shares"}),
        (
            DOUBLET.replace("10.0", '"ten"')
            + TABLE.format([0.0, 0.1, 0.05], [1, 0, 0]).replace('"a"', '"b"'),
            {"pulses[1].amplitudes_nm[1]", "pulses[2].times_s"},
        ),
    ],
)
def test_pulses_that_cannot_be_are_refused_at_their_keys(with_pulses, pulses, keys):
    with pytest.raises(ProtocolError) as caught:
        load_protocol(with_pulses(pulses))
    assert {told.split(": ")[0] for told in caught.value.problems} == keys
    assert not [told for told in caught.value.problems if "Tuple" in told]


@pytest.mark.parametrize("lasts_s", ["10.1", "1e9", "1.7e308"])
def test_pulses_without_end_are_refused_at_once(with_pulses, lasts_s):
    for pulses in (
        PULSE.format("trapezoid") + f"hold_s = {lasts_s}\n",
        DOUBLET.replace("0.04, 0.02", f"{lasts_s}, {lasts_s}"),
        TABLE.format(f"[0.0, {lasts_s}]", [1, 1]),
    ):
        with pytest.raises(ProtocolError, match="pulses of at most 10 s"):
            load_protocol(with_pulses(pulses))


def test_a_table_with_rows_too_close_is_one_problem(with_pulses):
    times_s = [0.0005 * k + 1e-7 * k * k for k in range(1000)]
    with pytest.raises(ProtocolError, match=r"times_s: .*at least one period") as caught:
        load_protocol(with_pulses(TABLE.format(times_s, [1] * 1000)))
    assert sum("times_s" in told for told in caught.value.problems) == 1


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.sampled_from(["walking", "walking_doublets"]),
    st.floats(0, 1, exclude_max=True),
    st.sampled_from(["", "x = 1", "pulse = 1", "[[conditions]]", "[safety]", "name = [1, {}]"]),
    st.sampled_from(["3", '"x"', "-1", "[]", "{}", "nan", "true", "[[1], 2]"]),
)
def test_a_spoilt_file_is_read_or_refused_with_its_problems(tmp_path, name, place, line, value):
    lines = protocol_text(name).splitlines()
    k = int(place * len(lines))
    spoilt = lines[k].split("=")[0] + "= " + value if "=" in lines[k] and not line else line
    file = tmp_path / "spoilt.toml"
    file.write_text("\n".join([*lines[:k], spoilt, *lines[k + 1 :]]))

    with contextlib.suppress(ProtocolError):
        assert load_protocol(file).kind == "walking"
