"""What an agreement is worth: settings from print, results that follow from them, and counts."""

import json
import re

import numpy as np
import pytest
from reproduction import printed_settings as settings
from reproduction import reproduce
from reproduction.chapter4.person_tables import means_table
from reproduction.chapter4.published_statistics import averages, pilot_people
from reproduction.chapter4.reproduce_chapter4 import simulated_chapter
from reproduction.chapter4.stated_trends import stated_trends
from reproduction.chapter4.walking import WalkedStudy
from reproduction.chapter_page import render_validation
from reproduction.reproduction_result import Reproduction
from reproduction.reproduction_tables import (
    Claim,
    ClaimTable,
    Compared,
    ComparedTable,
    audit_claims,
    tally,
    tally_text,
)
from reproduction.tests.test_walking import gait, study
from scipy.stats import spearmanr
from tests.unit.report.pages import Page

from jointz.reference import chapter4
from jointz.rig.sim.benches.sea import sea_preset

NUMBERS = ComparedTable(
    "numbers",
    "Numbers",
    "",
    (
        Compared("bandwidth", "Hz", 17.2, dissertation=17.0, built_in="torque loop"),
        Compared("both SDs", "%", -5.0, dissertation=-8.0, printed_sd=2.0, dissertation_sd=1.5),
        Compared("outside", "%", -5.0, dissertation=-9.0, printed_sd=2.0, dissertation_sd=1.5),
        Compared("without a method of the print", "%", 81.0, recommended=78.0),
        Compared("VAF", "%", 95.0, dissertation=99.98),
        Compared("rounded", "", 0.01, recommended=0.0075),
        Compared("not ours", "%", 15.0),
        Compared("not printed", "%", recommended=1.0),
    ),
)  # fmt: skip
VERDICTS = {
    "reproduced": "measured here",
    "not shown": "measured here",
    "not reproduced": "contradicted",
    "only with replicates as people": "contradicted",
    "contradiction": "contradicted",
    "not possible": "contradicted",
    "ambiguous": "not judged",
    "worth knowing": "not judged",
    "not tested": "not judged",
}
CLAIMS = ClaimTable(
    "claims",
    "Claims",
    "",
    (
        *(Claim("2.4", verdict, "so", "so", verdict) for verdict in VERDICTS),
        Claim("2.4", "given", "so", "so", "reproduced", built_in="spring"),
        Claim("2.4", "given, other outcome", "so", "not so", "not reproduced", built_in="spring"),
    ),
)
COUNTS = {"built in": 3, "measured here": 5, "contradicted": 6, "not judged": 3}
CHAPTER = Reproduction(2, "The bench", (NUMBERS, CLAIMS))


def test_a_number_agrees_within_both_sds_or_five_percent_or_half_a_digit():
    assert [row.evidence for row in NUMBERS.rows] == [
        "built in", "measured here", "contradicted", "measured here", "contradicted",
        "measured here", "not judged", "not judged",
    ]  # fmt: skip


def test_every_verdict_is_of_one_kind_and_what_was_given_confirms_nothing():
    kinds = {row.claim: row.evidence for row in CLAIMS.rows}
    assert kinds == VERDICTS | {"given": "built in", "given, other outcome": "built in"}


def test_counts_are_in_the_result_and_its_json_and_at_the_top_of_the_page():
    assert CHAPTER.evidence == tally(CHAPTER.tables) == COUNTS
    plain = json.loads(json.dumps(CHAPTER.to_dict()))
    assert plain["evidence"] == COUNTS
    assert Reproduction.from_dict(plain) == CHAPTER
    sentence = tally_text(COUNTS)
    assert "Of 17 printed" in sentence
    assert "3 are built in" in sentence
    other = Reproduction(3, "Another", (NUMBERS,))
    html = render_validation([(CHAPTER, {}), (other, {})])
    page, top = Page(html), html.split("<article")[0]
    assert "Of 23 printed numbers and statements, 4 are built in" in top
    cells = re.findall(r"<td class=\"v\">(\d+)</td>", top)
    assert [int(n) for n in cells] == [3, 5, 6, 3, 1, 3, 2, 0, 4, 8, 8, 3]
    assert "torque loop" in page.text


def test_the_command_ends_with_the_counts(command, tmp_path, monkeypatch):
    monkeypatch.setattr(reproduce, "_CHAPTERS", {2: lambda *_: CHAPTER})
    code, out = command("2", "--out", tmp_path / "a")
    assert code == 0
    assert out.rstrip().endswith(tally_text(COUNTS))
    _, told = command("2", "--out", tmp_path / "b", "--json")
    assert told["evidence"] == told["chapters"][0]["evidence"] == COUNTS


# --- settings taken from print -------------------------------------------------------------------


@pytest.mark.parametrize("chapter", [2, 3, 4])
def test_settings_are_those_of_the_simulation_and_near_the_print(chapter):
    rows = settings.printed_settings(chapter, "nominal").rows
    assert len({row.quantity for row in rows}) >= len(rows) - 1
    for row in rows:
        assert row.note, row.quantity
        assert row.evidence == "not judged"
        if row.printed is not None:
            assert row.truth == pytest.approx(row.printed, rel=0.11)


def test_the_table_shows_the_preset_that_ran():
    rows = {row.quantity: row for row in settings.printed_settings(2, "hard").rows}
    supply = rows["torque loop: supply voltage, V"]
    assert supply.truth == sea_preset("hard").machine.supply_v
    assert "2.3.1" in supply.note
    noise = [row for row in settings.printed_settings(3, "hard").rows if "noise" in row.quantity]
    assert [(row.printed, row.truth) for row in noise] == [(0.33, 0.5)]


def test_what_is_built_in_names_a_setting_of_its_chapter():
    names = {
        chapter: [row.quantity for row in settings.printed_settings(chapter, "nominal").rows]
        for chapter in (2, 3, 4)
    }
    whole = study()
    tables, _ = simulated_chapter(
        WalkedStudy(whole.people, whole.estimates, whole.population, gait())
    )
    rows = [row for table in tables for row in getattr(table, "rows", ())]
    used = {(4, row.built_in) for row in rows if row.built_in}
    assert len(used) == 4
    used |= {(2, settings.TORQUE_LOOP), (2, "intrinsic damping")}
    used |= {(3, name) for name in (settings.MODEL, settings.SPRING, settings.SENSOR_NOISE)}
    for chapter, setting in used:
        assert any(name.startswith(setting) for name in names[chapter]), setting


def test_simulated_people_confirm_neither_their_means_nor_what_differs_between_them():
    kinds = {row.quantity: row.evidence for row in means_table(study()).rows}
    assert {k for q, k in kinds.items() if not q.startswith("VAF")} == {"built in"}
    assert "built in" not in {k for q, k in kinds.items() if q.startswith("VAF")}
    whole = study()
    tables, _ = simulated_chapter(
        WalkedStudy(whole.people, whole.estimates, whole.population, gait())
    )
    claims = {row.claim: row.evidence for row in tables[-1].rows}
    assert set(claims.values()) == {"built in", "not judged"}
    assert claims["inertia, subject, by the dissertation's method"] == "built in"
    assert claims["the device has no effect on gait"] == "built in"


def test_printed_tables_agree_with_their_own_averages():
    rows = [*averages().rows, *pilot_people().rows]
    assert {row.evidence for row in rows} == {"measured here"}


# --- statements that the text makes in passing ----------------------------------------------------


def cells(table):
    return np.array([[c.value for c in row.values()] for row in table.values()]).T


def test_trends_and_fits_are_computed_from_the_tables():
    antagonistic, mirrored, tucker, explained, second = stated_trends().rows
    K, B, vaf = (cells(t) for t in (chapter4.STIFFNESS, chapter4.DAMPING, chapter4.VAF))
    pilot = [1, 2]
    steps = [(K[p, i + 1] - K[p, i]) * (B[p, i + 1] - B[p, i]) < 0 for p in pilot for i in range(2)]
    assert f"of means opposite in 2 of 2, of people in {sum(steps)} of 4" in antagonistic.ours
    assert antagonistic.verdict == "not shown"
    inverse = sum(np.corrcoef(K[p, 1:4], B[p, 1:4])[0, 1] < 0 for p in range(10))
    assert f"inverse in {inverse} of 10 people" in mirrored.ours
    assert (inverse, mirrored.verdict) == (8, "not shown")
    assert tucker.printed == "about 72 %, ours about 91 %"
    assert f"{vaf.mean():.2f} % in table 4.4; {(vaf <= 72).sum()} of 60" in tucker.ours
    rank, p = spearmanr(vaf.ravel(), B.ravel())
    assert f"{rank:.2f} (p = {p:.2f})" in explained.ours
    assert explained.verdict == "not shown"
    assert f"{(vaf > 97).sum()} of 60" in second.ours
    assert second.verdict == "not reproduced"


def test_no_statement_is_judged_by_the_audit_and_by_a_table():
    wheres = [row.where for row in audit_claims(4).rows]
    assert "4.3.2.2" not in wheres
    assert {row.where[0] for row in audit_claims(3).rows} <= set("3T")
    assert "4.3.2.1, Table 4.2" in wheres
