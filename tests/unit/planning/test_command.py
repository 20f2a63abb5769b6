"""``jointz plan`` as a command: its folder, its exit codes, what it prints."""

import json
import shlex
from dataclasses import replace

import pandas as pd
import pytest

from jointz.core.errors import DataError, OutputError, WriteError
from jointz.io.protocols import load_protocol
from jointz.planning.page import write_plan
from jointz.planning.plan_result import Plan
from jointz.rig.session.rigs.rig_settings import rig_settings

pytestmark = pytest.mark.usefixtures("bare_plan")
FILES = {"plan.html", "plan.csv", "plan.json", "half_widths.svg", "pulses.svg", "protocol.toml"}


@pytest.fixture(scope="module")
def protocol(made, tmp_path_factory):
    """A protocol file of one timing point."""
    file = tmp_path_factory.mktemp("protocol") / "one.toml"
    file.write_text(made.protocol_text)
    return file


def names(folder):
    return {p.name for p in folder.iterdir() if p.name[0] != "."}


def refused(plan):
    return replace(plan, refused=("Nothing can be had.",), protocol_text="")


# --- the folder ----------------------------------------------------------------------------------


def test_the_folder_has_page_table_json_figures_and_protocol(made, tmp_path):
    page = write_plan(made, tmp_path / "plan")

    assert page == tmp_path / "plan" / "plan.html"
    assert names(tmp_path / "plan") >= FILES
    assert Plan.from_dict(json.loads((page.parent / "plan.json").read_text())) == made
    table = pd.read_csv(page.parent / "plan.csv")
    pd.testing.assert_frame_equal(table, made.to_frame(), rtol=1e-5)
    assert load_protocol(page.parent / "protocol.toml").participants == made.participants
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") == 2
    assert "http://" not in text.replace("http://www.w3.org", "").replace("http://purl.org", "")
    for shape in made.shapes:
        assert shape.name in text


def test_a_refused_plan_is_not_written(made, tmp_path):
    with pytest.raises(DataError, match=r"Nothing can be had\."):
        write_plan(refused(made), tmp_path / "plan")

    assert list(tmp_path.iterdir()) == []


def test_an_earlier_plan_is_replaced_only_if_asked(made, tmp_path):
    write_plan(made, tmp_path / "plan")
    with pytest.raises(OutputError, match="exists"):
        write_plan(made, tmp_path / "plan")

    write_plan(replace(made, protocol_text=""), tmp_path / "plan", overwrite=True)

    assert not (tmp_path / "plan" / "protocol.toml").exists()


def test_what_is_no_plan_is_not_replaced(made, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "data.csv").write_text("1")

    with pytest.raises(OutputError):
        write_plan(made, tmp_path / "mine", overwrite=True)

    assert names(tmp_path / "mine") == {"data.csv"}


@pytest.mark.parametrize("earlier", [False, True])
def test_a_failure_leaves_nothing_half_written(made, tmp_path, monkeypatch, earlier):
    out = tmp_path / "new" / "plan"
    if earlier:
        write_plan(made, out)
        before = {p.name: p.read_bytes() for p in out.iterdir() if p.is_file()}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("jointz.planning.page.render_plan", full)
    with pytest.raises(WriteError, match="No space left"):
        write_plan(made, out, overwrite=earlier)

    if earlier:
        assert {p.name: p.read_bytes() for p in out.iterdir() if p.is_file()} == before
        assert {p.name for p in out.parent.iterdir()} == {"plan"}
    else:
        assert list(tmp_path.iterdir()) == []


# --- the command ---------------------------------------------------------------------------------


def test_a_plan_is_written_and_the_next_step_is_named(jointz, protocol, tmp_path):
    outcome = jointz("plan", protocol, "--out", tmp_path / "plan")

    assert outcome.code == 0, outcome.err
    assert names(tmp_path / "plan") >= FILES
    file = tmp_path / "plan" / "protocol.toml"
    assert f"jointz run {file} --sensors goniometer --out STUDY" in outcome.out
    assert "is expected to abort" in outcome.out
    assert "10 participants, 7 min of walking each" in outcome.out
    again = jointz("plan", protocol, "--out", tmp_path / "plan")
    assert again.code == 2
    assert "exists" in again.err


def test_options_reach_the_plan_and_json_is_one_document(jointz, protocol, tmp_path):
    out = tmp_path / "plan"
    options = ("--sensor", "goniometer=0.5", "--sensor", "encoder", "--mass", 90, "--seed", 3)
    wishes = ("--minutes", 6, "--motion", 10, "--share", 70, "--of", "B,J")

    outcome = jointz("plan", protocol, "--out", out, "--json", *options, *wishes)

    assert outcome.code == 0, outcome.err
    assert outcome.json["status"] == "ok"
    assert outcome.json["page"] == str(out / "plan.html")
    plan = Plan.from_dict(outcome.json["plan"])
    assert plan.sensors == ("goniometer", "encoder")
    assert plan.minutes <= 6.0
    assert plan.provenance["seed"] == 3
    expected = {"share": 0.7, "minutes": 6.0, "motion_deg": 10.0}
    assert {k: plan.wishes[k] for k in expected} == expected
    assert list(plan.wishes["parameters"]) == ["damping", "inertia"]


@pytest.mark.parametrize("options", [(), ("--json",), ("--quiet",)], ids=str)
def test_a_refused_wish_ends_with_1_and_writes_nothing(jointz, protocol, tmp_path, options):
    outcome = jointz("plan", protocol, "--out", tmp_path / "plan", "--half-width", 5, *options)

    assert outcome.code == 1
    assert "Nearest: " in outcome.out + outcome.err
    assert list(tmp_path.iterdir()) == []


def test_a_refused_wish_keeps_an_earlier_plan(jointz, made, protocol, tmp_path):
    write_plan(made, tmp_path / "plan")

    outcome = jointz(
        "plan", protocol, "--out", tmp_path / "plan", "--half-width", 5, "--overwrite", "--json"
    )

    assert outcome.code == 1
    assert outcome.json["status"] == "refused"
    assert outcome.json["page"] == ""
    assert (tmp_path / "plan" / "protocol.toml").read_text() == made.protocol_text


def test_the_printed_command_runs_what_was_planned(jointz, protocol, tmp_path):
    out = tmp_path / "my plan"
    planned = jointz(
        "plan", protocol, "--out", out, "--sensor", "goniometer", "--sensor", "encoder"
    )
    (line,) = (x for x in planned.out.splitlines() if x.startswith("Next: jointz "))

    spec = load_protocol(out / "protocol.toml")
    assert spec.sensors == ("goniometer", "encoder")
    words = shlex.split(line.removeprefix("Next: jointz "))
    file, sensors = str(out / "protocol.toml"), "goniometer,encoder"
    assert words == ["run", file, "--sensors", sensors, "--out", "STUDY"]
    assert rig_settings(spec, "sim", None, 1).sensors == spec.sensors
    again = jointz("plan", out / "protocol.toml", "--out", tmp_path / "again", "--json")
    assert again.json["plan"]["sensors"] == ["goniometer", "encoder"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "expected either a protocol"),
        (("walking", "--study", "results"), "expected either a protocol"),
        (("walking", "--study-folder", "."), "--study-folder goes with --study"),
        (("--study", "results", "--mass", 80), "expected no mass_kg"),
        (("walking", "--of", "K,Q"), "--of: expected some of K,B,J; got Q"),
        (("walking", "--sensor", "goniometer=small"), "NAME=NOISE in degrees"),
        (("walking", "--sensor", "imu"), "expected a goniometer"),
        (("walking", "--half-width", 200), "half_width_pct: expected 1 to"),
        (("walking", "--share", 99), "expected 50 to 95"),
        (("sea-bandwidth",), "has no pulses in walking"),
        (("no-such-protocol",), "no-such-protocol"),
        (("walking", "--seed", -1), "seed"),
    ],
    ids=str,
)
def test_bad_input_ends_with_2_and_writes_nothing(jointz, tmp_path, arguments, says):
    (tmp_path / "results").mkdir()

    outcome = jointz("plan", *arguments, "--out", tmp_path / "plan")

    assert outcome.code == 2
    assert says in " ".join(outcome.err.split())
    assert not (tmp_path / "plan").exists()
