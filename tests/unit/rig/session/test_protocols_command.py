"""``jointz protocols``: list, show, check."""

import pytest

from jointz.core.protocols.protocol import Protocol
from jointz.io.protocols import builtin_protocols, load_protocol, protocol_text


@pytest.fixture
def wrong(tmp_path):
    text = protocol_text("walking").replace("[3, 7]", "[7, 3]").replace("seed = 1", "sed = 1")
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("path", [("protocols",), ("protocols", "list")])
def test_the_list_shows_how_long_each_takes(jointz, path):
    rows = [line.split("\t")[:5] for line in jointz(*path).out.splitlines()]
    assert ["sea-mass-spring", "2.2.3", "5", "280", "15 min"] in rows
    entries = {entry["name"]: entry for entry in jointz(*path, "--json").json["protocols"]}
    assert len(entries) == len(rows) - 1
    assert entries["walking"]["expected_duration_s"] == pytest.approx(1793.0)
    assert entries["walking"]["conditions"] == ["no_device", "unperturbed", "perturbed"]


def test_what_is_shown_is_a_protocol_to_start_from(jointz, tmp_path):
    outcome = jointz("protocols", "show", "walking")
    (tmp_path / "mine.toml").write_text(outcome.out)

    assert load_protocol(tmp_path / "mine.toml") == load_protocol("walking")
    assert jointz("protocols", "show", "walking", "--quiet").out == protocol_text("walking")
    shown = jointz("protocols", "show", "walking", "--json").json
    assert Protocol.model_validate(shown["protocol"]) == load_protocol("walking")


def test_check_ends_with_zero_or_with_two_and_every_problem_at_its_place(jointz, wrong):
    sound = jointz("protocols", "check", "walking", "--json")
    assert (sound.code, sound.err, sound.json["problems"]) == (0, "", [])
    assert jointz("protocols", "check", "walking", "--quiet").out == ""
    told = jointz("protocols", "check", wrong, "--json")
    places = [problem.split(":")[0] for problem in told.json["problems"]]
    assert told.code == 2
    assert sorted(places) == ["conditions[3].perturbations.gap_strides", "sed"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("show", "wallking", "--json"), "'walking'"),
        (("check", "wallking", "--json"), "'walking'"),
        (("--json", "list"), "after the command"),
        (("--quiet", "list"), "after the command"),
    ],
)
def test_what_is_not_there_or_in_the_wrong_place_ends_with_two(jointz, arguments, told):
    outcome = jointz("protocols", *arguments)
    assert outcome.code == 2
    assert told in outcome.out + outcome.err


def drawn(jointz, name):
    text = jointz("protocols", "show", name)
    return text.out.removesuffix(protocol_text(name)).splitlines()


@pytest.mark.parametrize("name", builtin_protocols())
def test_what_stands_above_a_protocol_has_at_most_a_hundred_columns(jointz, name):
    assert max(map(len, drawn(jointz, name))) <= 100


def test_a_table_that_only_goes_down_is_drawn_below_zero(jointz, tmp_path):
    text = protocol_text("walking_doublets")
    table = (
        f'[[pulses]]\nname = "{"x" * 64}"\nkind = "samples"\n'
        "amplitudes_nm = [1.123456, 2.123456, 3.123456]\n"
        "times_s = [0.0, 0.05, 0.1]\nshares = [-0.5, -0.5, -1.0]\n"
    )
    begin, end = text.index("[[pulses]]"), text.index("[expected_joint]")
    file = tmp_path / "table.toml"
    file.write_text(text[:begin] + table + text[end:])
    lines = drawn(jointz, file)
    rows = [line for line in lines if "█" in line]
    (zero,) = (line for line in lines if "─" in line)
    assert max(map(len, lines)) <= 100
    assert lines.index(zero) < lines.index(rows[0])
    assert [row.count("█") for row in rows] == sorted((r.count("█") for r in rows), reverse=True)
    assert rows[1].count("█") == 48
    assert "-3.12346 N*m" in rows[-1]
