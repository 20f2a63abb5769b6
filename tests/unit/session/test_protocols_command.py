"""``jointz protocols``: list, show, check."""

import pytest

from jointz.core.protocols.protocol import Protocol
from jointz.io.protocols import load_protocol, protocol_text


@pytest.fixture
def wrong(tmp_path):
    text = protocol_text("walking").replace("[3, 7]", "[7, 3]").replace("seed = 1", "sed = 1")
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("path", [("protocols",), ("protocols", "list")])
def test_the_list_shows_how_long_each_takes(jointz, path):
    outcome = jointz(*path)

    assert outcome.code == 0
    rows = [line.split("\t") for line in outcome.out.splitlines()]
    assert ["sea-mass-spring", "2.2.3", "5", "280", "15 min"] in [row[:5] for row in rows[1:]]
    assert [row[:5] for row in rows[-2:]] == [
        ["walking", "4.2", "10", "300", "30 min"],
        ["walking-pilot", "3.2.4", "2", "300", "29 min"],
    ]


@pytest.mark.parametrize("path", [("protocols",), ("protocols", "list")])
def test_the_list_as_json(jointz, path):
    outcome = jointz(*path, "--json")

    names = [entry["name"] for entry in outcome.json["protocols"]]
    assert len(names) == 17
    assert names[-2:] == ["walking", "walking-pilot"]
    first = outcome.json["protocols"][-2]
    assert first["expected_duration_s"] == pytest.approx(1793.0)
    assert first["conditions"] == ["no_device", "unperturbed", "perturbed"]


def test_what_is_shown_is_a_protocol_to_start_from(jointz, tmp_path):
    outcome = jointz("protocols", "show", "walking")
    (tmp_path / "mine.toml").write_text(outcome.out)

    assert outcome.out.startswith("# walking: 3 conditions and 300 pulses take about 30 min a part")
    assert load_protocol(tmp_path / "mine.toml") == load_protocol("walking")
    assert jointz("protocols", "show", "walking", "--quiet").out == protocol_text("walking")
    shown = jointz("protocols", "show", "walking", "--json").json
    assert Protocol.model_validate(shown["protocol"]) == load_protocol("walking")


def test_check_of_a_sound_protocol_ends_with_zero(jointz):
    told = jointz("protocols", "check", "walking")

    assert (told.code, told.err) == (0, "")
    assert told.out.startswith("walking: no problems. 3 conditions and 300 pulses")
    assert jointz("protocols", "check", "walking", "--quiet").out == ""
    assert jointz("protocols", "check", "walking", "--json").json["problems"] == []


def test_check_reports_every_problem_and_ends_with_two(jointz, wrong):
    told = jointz("protocols", "check", wrong)

    assert (told.code, told.out) == (2, "")
    assert "wrong.toml: 2 problems" in told.err
    assert len(jointz("protocols", "check", wrong, "--json").json["problems"]) == 2
    assert "sed: unknown key. Did you mean 'seed'?" in told.err
    assert "conditions[3].perturbations.gap_strides: expected [fewest, most]" in told.err


@pytest.mark.parametrize("command", ["show", "check"])
def test_a_protocol_that_is_not_there_ends_with_two(jointz, command):
    told = jointz("protocols", command, "wallking", "--json")

    assert told.code == 2
    assert "Did you mean 'walking'" in told.json["message"]


@pytest.mark.parametrize("option", ["--json", "--quiet"])
def test_options_before_the_command_are_not_lost_silently(jointz, option):
    told = jointz("protocols", option, "list")

    assert told.code == 2
    assert "after the command" in told.err


def test_a_bench_protocol_is_told_by_its_loads(jointz, tmp_path):
    file = tmp_path / "bench.toml"
    file.write_text(
        'jointz_protocol = 1\nname = "b"\ntitle = "B"\nkind = "bench"\njoint = "testbench"\n'
        '[[loads]]\nname = "k1"\n[[loads]]\nname = "k2"\n'
        '[[conditions]]\nname = "a"\ncondition = "perturbed"\nprompt = ""\nduration_s = 60.0\n'
        'torque_nm = { kind = "sine", amplitude = 10.0, frequency_hz = 0.1 }\n'
    )

    assert jointz("protocols", "check", file).out.endswith(
        "1 condition and 0 pulses take about 1 min a load; 2 loads.\n"
    )
