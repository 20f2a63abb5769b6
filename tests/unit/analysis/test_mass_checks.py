"""Masses that nobody has, and the values per kg that they would give."""

import pandas as pd
import pytest

from jointz.analysis.mass_checks import mass_questions, mass_remarks, without_values_per_kg
from jointz.io.study_reader import open_study
from jointz.results.estimates import CellEstimate, ParameterEstimate


def of_people(study, *bodies, kind="walking"):
    """Return the study with the mass and height of its two people changed."""
    toml = study.toml
    if kind == "bench":
        toml = toml.replace('kind = "walking"\ncoupling = "rigid"', 'kind = "bench"')
    lines, people = [], iter(bodies)
    for line in toml.splitlines():
        if line.startswith(("mass_kg", "height_m")):
            continue
        lines.append(line)
        if line.startswith("id = "):
            mass, height = next(people, (70.0, 1.75))
            lines.append(f"mass_kg = {mass}")
            lines += [] if height is None else [f"height_m = {height}"]
    (study.root / "study.toml").write_text("\n".join(lines))
    return open_study(study.root)


def cell(inertia, status="ok"):
    low, high = 0.9 * inertia, 1.1 * inertia
    parameters = (
        ParameterEstimate("stiffness", 70.0, 60.0, 80.0, "ok"),
        ParameterEstimate("inertia", inertia, low, high, status),
        ParameterEstimate("stiffness_per_mass", 1.0, 0.9, 1.1, "ok"),
        ParameterEstimate("damping_per_mass", 0.1, 0.09, 0.11, "ok"),
    )
    return CellEstimate("S01", "MST", 21.5, parameters, 99.0, 10, 0, "rigid")


@pytest.mark.parametrize(
    ("mass", "height", "likely"),
    [
        (6.4, 1.75, "kg with a lost digit (64 kg)"),
        (6.4, None, "kg with a lost digit (64 kg)"),
        (165.0, 1.75, "pounds (74.8 kg)"),
        (72500.0, 1.75, "grams (72.5 kg)"),
        (711.0, None, "newtons (72.5 kg)"),
        (11.4, None, "stone (72.4 kg)"),
        (72.5, 0.9, "Is height_m in metres?"),
        (20.0, None, "give height_m, too"),
    ],
)
def test_a_mass_that_nobody_has_is_asked_about_with_the_likely_unit(
    small_study, mass, height, likely
):
    (person,) = questions = mass_questions(of_people(small_study, (mass, height)), [])
    assert person == "S01"
    assert f"is mass_kg = {mass:g}" in questions["S01"]
    assert likely in questions["S01"]


@pytest.mark.parametrize(
    ("mass", "height"),
    [(45.0, 1.55), (72.5, None), (72.5, 1.75), (120.0, 1.8), (18.0, 1.1), (25.0, 1.3)],
)
def test_people_that_exist_are_not_asked_about(small_study, mass, height):
    study = of_people(small_study, (mass, height))
    assert not mass_questions(study, [cell(0.05), cell(0.4)])
    assert not mass_remarks(study, {})


def test_a_load_on_a_bench_may_have_any_mass(small_study):
    study = of_people(small_study, (0.4, None), kind="bench")
    assert not mass_questions(study, [cell(5.0)])
    assert not mass_remarks(study, {})


def test_one_heavy_person_is_asked_about_and_keeps_the_values(small_study):
    study = of_people(small_study, (140.0, 1.75))
    assert not mass_questions(study, [])
    (remark,) = mass_remarks(study, {})
    assert "body mass index of 46" in remark
    assert "pounds (63.5 kg)" in remark


@pytest.mark.parametrize("heights", [(1.75, 1.65), (None, None)])
def test_a_study_of_heavy_people_is_in_pounds(small_study, heights):
    study = of_people(small_study, (140.0, heights[0]), (125.0, heights[1]))
    questions = mass_questions(study, [])
    assert list(questions) == ["S01", "S02"]
    assert all("pounds" in q for q in questions.values())


@pytest.mark.parametrize(
    ("inertia", "status", "intrinsic", "asked"),
    [
        (1.2, "ok", False, True),
        (1.2, "at_bound", False, False),
        (0.8, "ok", False, False),
        (0.8, "ok", True, True),
        (0.01, "ok", True, False),
    ],
)
def test_an_inertia_that_no_leg_of_this_mass_has_asks_for_the_mass(
    small_study, inertia, status, intrinsic, asked
):
    study = of_people(small_study, (70.0, 1.75))
    if intrinsic:
        known = "[calibration]\nintrinsic_inertia = { value = 0.02, sd = 0.001 }\n"
        small_study.edit_toml("[[participants]]", f"{known}[[participants]]", 1)
        study = open_study(small_study.root)
    assert ("S01" in mass_questions(study, [cell(inertia, status)])) == asked


def test_only_values_per_kg_are_withheld():
    (mine,) = without_values_per_kg([cell(0.05)], {"S01"})
    assert {p.name: p.status for p in mine.parameters} == {
        "stiffness": "ok",
        "inertia": "ok",
        "stiffness_per_mass": "failed:mass_unlikely",
        "damping_per_mass": "failed:mass_unlikely",
    }
    assert mine.parameters[2].value is None
    assert without_values_per_kg([cell(0.05)], {"S02"}) == [cell(0.05)]


def test_an_unlikely_mass_fails_the_values_per_kg_of_its_person_and_of_no_other(
    small_study, jointz, tmp_path
):
    of_people(small_study, (6.4, 1.75), (70.0, 1.75))
    out = tmp_path / "out"
    done = jointz("analyze", small_study.root, "--out", out, "--method", "pre_pulse",
                  "--resamples", 2, "--no-figures", "--json")  # fmt: skip

    rows = pd.read_csv(out / "estimates.csv")
    per_kg = rows[rows["parameter"].str.endswith("_per_mass")]
    unlikely = per_kg["status"] == "failed:mass_unlikely"
    assert done.code == 0
    assert set(per_kg.loc[unlikely, "participant"]) == {"S01"}
    assert unlikely.sum() == (per_kg["participant"] == "S01").sum()
    assert per_kg.loc[unlikely, "value"].isna().all()
    assert "ok" in set(rows.loc[rows["parameter"] == "stiffness", "status"])
    means = pd.read_csv(out / "population.csv")
    assert (means.loc[means["parameter"] == "stiffness_per_mass", "n_participants"] <= 1).all()
    assert "mass_kg = 6.4" in (out / "report.html").read_text()
