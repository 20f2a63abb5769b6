"""People to studies, studies to a mean: what is pooled, what is counted, what is refused."""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from benchmarks.collection_entries import write_entry

from jointz.analysis.analyze import analyze
from jointz.collections.catalog import build_catalog
from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.catalog_query import CatalogFilter
from jointz.collections.coverage import PoolRules, RawStudy, pool_collection, reanalysed
from jointz.collections.pool import pool_catalog
from jointz.collections.pool_result import BY, CollectionPool
from jointz.core.errors import DataError
from jointz.io.study_reader import open_study
from jointz.kernels.statistics.between_study_variance import random_effects
from jointz.results.estimates import COVARIANCE_COLUMNS

mpl.use("Agg")

UNITS = {"stiffness": "N*m/rad", "damping": "N*m*s/rad", "inertia": "kg*m^2"}
#: People of fictional labs, stiffness in N*m/rad.
LABS = {
    "lab-a": [52.0, 61.0, 66.0, 70.0],
    "lab-b": [48.0, 55.0, 59.0],
    "lab-c": [63.0, 71.0, 80.0, 77.0, 69.0],
}


def rows(study: str, people: list[float], **told: Any) -> pd.DataFrame:
    """Return rows of a catalog, one a person, with intervals of 1 N*m/rad either side."""
    blank = {name: np.nan if kind == "number" else "" for name, kind in CATALOG_COLUMNS.items()}
    about = {
        "entry": study, "study": study, "version": "1", "values": "estimates",
        "statistic": "individual", "joint": "knee", "side": "left", "condition": "level",
        "activity": "walking", "walking_speed_m_s": 1.2, "slope_deg": 0.0, "timing_point": "MST",
        "onset_gait_pct": 21.5, "parameter": "stiffness", "method": "rigid", "status": "ok",
        "licence": "CC-BY-4.0", "cite": f"{study}, fictional", "n": 1.0,
    }  # fmt: skip
    made = pd.DataFrame([blank | about | told] * len(people))
    made["unit"] = made["parameter"].map(UNITS)
    made["participant"] = [f"P{k}" for k in range(len(people))]
    made["value"] = people
    made["ci_low"], made["ci_high"] = made["value"] - 1.0, made["value"] + 1.0
    return made[list(CATALOG_COLUMNS)]


def catalog(**told: Any) -> pd.DataFrame:
    """Return the three labs."""
    return pd.concat([rows(lab, values, **told) for lab, values in LABS.items()], ignore_index=True)


def only(pool: CollectionPool) -> Any:
    """Return the one pooled row."""
    assert len(pool.table) == 1
    return pool.table.iloc[0]


def test_people_are_averaged_to_studies_and_studies_pooled() -> None:
    means = np.array([np.mean(v) for v in LABS.values()])
    variances = np.array([np.var(v, ddof=1) / len(v) for v in LABS.values()])
    fit = random_effects(means, variances, modified=True)
    pool = pool_catalog(catalog())
    row = only(pool)
    assert row["value"] == pytest.approx(fit.mean)
    assert (row["ci_low"], row["ci_high"]) == pytest.approx((fit.low, fit.high))
    assert (row["tau"] ** 2, row["i2_pct"]) == pytest.approx((fit.tau2, fit.i2_pct))
    assert (row["n_studies"], row["n_people"], row["status"]) == (3, 12, "ok")
    assert row["speed"] == "1.1 to 1.3 m/s"
    assert pool.studies["weight_pct"].tolist() == pytest.approx((100 * fit.weights).tolist())
    assert pool.available


def test_several_values_of_a_person_are_one_person() -> None:
    again = rows("lab-a", [v + 4.0 for v in LABS["lab-a"]], condition="second day")
    by = ("joint", "timing_point", "speed")
    pool = pool_catalog(pd.concat([catalog(), again], ignore_index=True), by=by)
    one = pool.studies.set_index("study").loc["lab-a"]
    assert one["n_people"] == 4
    assert one["value"] == pytest.approx(np.mean(LABS["lab-a"]) + 2.0)
    assert one["se"] == pytest.approx(np.std(LABS["lab-a"], ddof=1) / 2.0)


def test_what_has_no_value_is_counted_and_bounds_count_with_theirs() -> None:
    table = pd.concat([catalog(), rows("lab-d", [60.0, 62.0, 64.0, 66.0])], ignore_index=True)
    own = table.index[table["study"] == "lab-d"]
    table.loc[own[0], ["value", "ci_low", "ci_high"]] = np.nan
    table.loc[own[0], "status"] = "undecided"
    table.loc[own[1], ["value", "ci_low", "ci_high"]] = np.nan
    table.loc[own[1], "status"] = "failed:no_pulses"
    table.loc[own[2], "status"] = "at_bound"
    pool = pool_catalog(table)
    row = only(pool)
    assert (row["n_undecided"], row["n_failed"], row["n_at_bound"]) == (1, 1, 1)
    assert (row["n_studies"], row["n_people"]) == (4, 14)
    assert pool.studies.set_index("study").loc["lab-d", "value"] == pytest.approx(65.0)


def test_a_study_of_one_person_is_shown_and_not_pooled() -> None:
    alone = pd.concat([catalog(), rows("lab-d", [90.0])], ignore_index=True)
    pool, without = pool_catalog(alone), pool_catalog(catalog())
    assert only(pool)["value"] == only(without)["value"]
    assert (only(pool)["n_studies"], only(pool)["n_left_out"]) == (3, 1)
    left = pool.studies.set_index("study").loc["lab-d"]
    assert (left["status"], left["value"]) == ("one_person", 90.0)
    assert np.isnan(left["weight_pct"])


def test_one_study_stands_by_itself_and_none_fails() -> None:
    row = only(pool_catalog(rows("lab-a", LABS["lab-a"])))
    half = 3.1824463 * np.std(LABS["lab-a"], ddof=1) / 2.0
    assert row["status"] == "one_study"
    assert row["ci_high"] - row["value"] == pytest.approx(half, rel=1e-6)
    assert np.isnan(row["tau"])
    assert np.isnan(row["prediction_low"])
    none = pool_catalog(rows("lab-d", [90.0]))
    assert only(none)["status"] == "failed:too_few_studies"
    assert not none.available


def test_methods_are_not_mixed_unless_asked() -> None:
    other = rows("lab-d", [40.0, 44.0, 49.0], method="dissertation")
    table = pd.concat([catalog(), other], ignore_index=True)
    apart = pool_catalog(table)
    assert apart.table.set_index("methods")["n_studies"].to_dict() == {
        "rigid": 3, "dissertation": 1,
    }  # fmt: skip
    mixed = pool_catalog(table, mix_methods=True)
    assert (only(mixed)["methods"], only(mixed)["n_studies"]) == ("dissertation, rigid", 4)
    twice = pd.concat([table, rows("lab-a", LABS["lab-a"], method="dissertation")])
    with pytest.raises(DataError, match="lab-a has several"):
        pool_catalog(twice.reset_index(drop=True), mix_methods=True)


def printed_rows(**told: Any) -> pd.DataFrame:
    """Return a printed mean over 10 people."""
    made = rows("thesis", [58.0], values="printed", statistic="mean", status="", sd=6.0, **told)
    return made.assign(n=10.0, participant="", ci_low=np.nan, ci_high=np.nan)


def test_printed_values_stand_apart_and_are_named_where_they_are_pooled() -> None:
    table = pd.concat([catalog(), printed_rows()], ignore_index=True)
    apart = pool_catalog(table)
    assert only(apart)["n_studies"] == 3
    assert only(apart)["printed"] == ""
    assert apart.printed["study"].tolist() == ["thesis"]
    assert apart.printed["se"].tolist() == pytest.approx([6.0 / np.sqrt(10)])
    pooled = pool_catalog(table, with_printed=True)
    assert (only(pooled)["n_studies"], only(pooled)["n_people"]) == (4, 22)
    assert only(pooled)["printed"] == "thesis"
    assert pooled.printed["weight_pct"].notna().all()


def test_a_printed_mean_without_spread_cannot_be_pooled() -> None:
    table = pd.concat([catalog(), printed_rows().assign(sd=np.nan)], ignore_index=True)
    pool = pool_catalog(table, with_printed=True)
    assert only(pool)["n_studies"] == 3
    assert pool.printed["status"].tolist() == ["no_sd"]
    assert only(pool)["printed"] == ""


def test_of_printed_people_and_their_mean_the_one_of_more_people_counts() -> None:
    people = rows("thesis", [50.0, 60.0, 64.0], values="printed", status="ok")
    people[["ci_low", "ci_high"]] = np.nan
    for n, mean in ((3.0, 58.0), (10.0, 71.0)):
        told = printed_rows().assign(value=71.0, n=n)
        pool = pool_catalog(pd.concat([people, told], ignore_index=True), with_printed=True)
        row = pool.printed.iloc[0]
        assert (row["value"], row["n_people"]) == (pytest.approx(mean), n)


def test_what_is_not_stated_and_what_is_not_in_gait_are_told_apart() -> None:
    still = rows("lab-s", [40.0, 45.0], activity="seated", walking_speed_m_s=np.nan,
                 slope_deg=np.nan)  # fmt: skip
    table = pd.concat([catalog(slope_deg=np.nan), still], ignore_index=True)
    places = pool_catalog(table).table[["activity", "speed", "slope"]].to_numpy().tolist()
    assert places == [
        ["walking", "1.1 to 1.3 m/s", "not stated"], ["seated", "not in gait", "not in gait"],
    ]  # fmt: skip


def test_unlike_things_at_one_place_are_named() -> None:
    table = pd.concat([catalog(), rows("lab-h", [99.0, 88.0], joint="hip", group="patients")])
    notes = pool_catalog(table.reset_index(drop=True), by=("timing_point",)).notes
    for place in ("joint", "group"):
        assert any(f"--by {place}" in note for note in notes)


def test_covariances_that_stand_one_way_only_are_not_used() -> None:
    table = simulated(6, 8, 1)
    plain = pool_catalog(table, jointly=True)
    half = table.copy()
    half.loc[half["parameter"] == "stiffness", "with_damping"] = 0.3
    pd.testing.assert_frame_equal(pool_catalog(half, jointly=True).table, plain.table)


def test_a_gain_that_all_people_share_widens_their_study() -> None:
    plain = pool_catalog(catalog()).studies
    shared = pool_catalog(catalog(torque_gain_sd=0.03, angle_gain_sd=0.04)).studies
    added = shared["se"] ** 2 - plain["se"] ** 2
    assert added.tolist() == pytest.approx((0.05 * plain["value"]).pow(2).tolist())


def test_people_who_agree_better_than_their_intervals_get_no_weight_for_it() -> None:
    lucky = rows("lab-d", [60.0, 60.01, 59.99])
    lucky[["ci_low", "ci_high"]] = np.array([[40.0, 80.0]] * 3)
    pool = pool_catalog(pd.concat([catalog(), lucky], ignore_index=True))
    se = pool.studies.set_index("study").loc["lab-d", "se"]
    assert se == pytest.approx(20.0 / 1.959964 / np.sqrt(3), rel=1e-5)


def test_places_are_bands_of_speed_tenths_of_the_cycle_and_slopes() -> None:
    table = catalog(onset_gait_pct=100.0, slope_deg=-5.0)
    table.loc[:3, ["walking_speed_m_s", "onset_gait_pct", "slope_deg"]] = [0.3, 29.999, 0.0]
    table.loc[4:6, ["walking_speed_m_s"]] = np.nan
    pool = pool_catalog(table, by=("joint", "phase", "speed", "slope"))
    places = pool.table[["phase", "speed", "slope"]].to_numpy().tolist()
    assert places == [
        ["20 to 30 %", "0.3 to 0.5 m/s", "0 deg"],
        ["0 to 10 %", "not stated", "-5 deg"],
        ["0 to 10 %", "1.1 to 1.3 m/s", "-5 deg"],
    ]
    assert pool_catalog(table, by=BY).by == BY


def simulated(labs: int, people: int, seed: int, spread: float = 1.0) -> pd.DataFrame:
    """Return labs whose K, B and J go together between people and between labs."""
    rng = np.random.default_rng(seed)
    sizes = np.diag([8.0, 0.2, 0.03])
    between = sizes @ np.array([[1, 0.6, 0.3], [0.6, 1, 0.2], [0.3, 0.2, 1]]) @ sizes
    parts = []
    for lab in range(labs):
        gain = 1.0 + 0.03 * rng.normal()
        mean = rng.multivariate_normal([60.0, 1.5, 0.2], spread * between)
        own = gain * rng.multivariate_normal(mean, between, size=people)
        for k, name in enumerate(UNITS):
            part = rows(f"lab-{lab:02d}", own[:, k].tolist(), parameter=name, torque_gain_sd=0.03)
            error = 0.02 * own[:, k].mean()
            part["ci_low"], part["ci_high"] = part["value"] - error, part["value"] + error
            parts.append(part)
    return pd.concat(parts, ignore_index=True)


def test_parameters_are_pooled_together_where_studies_have_enough_people() -> None:
    table = simulated(9, 8, 1)
    small = table[(table["study"] != "lab-03") | table["participant"].isin(["P0", "P1", "P2"])]
    pool = pool_catalog(small.reset_index(drop=True), jointly=True)
    joint = pool.table[pool.table["model"] == "joint"].set_index("parameter")
    assert list(joint.index) == list(UNITS)
    assert set(joint["n_studies"]) == {8}
    assert set(joint["n_left_out"]) == {1}
    alone = pool.table[pool.table["model"] == "univariate"].set_index("parameter")
    assert (joint["value"] / alone["value"]).tolist() == pytest.approx([1.0] * 3, abs=0.05)
    assert (joint["tau"] / alone["tau"]).tolist() == pytest.approx([1.0] * 3, abs=0.3)
    few = pool_catalog(simulated(4, 8, 1), jointly=True)
    assert "joint" not in set(few.table["model"])


@pytest.mark.parametrize(
    ("change", "by", "place"),
    [
        (lambda t: t.drop(columns="method"), BY, "method"),
        (lambda t: t.assign(version=["1"] * 11 + ["2"]), BY, "lab-c: .* versions"),
        (lambda t: t, ("lab",), "by: "),
    ],
)
def test_rows_that_cannot_be_pooled_are_refused(change: Any, by: Any, place: str) -> None:
    with pytest.raises(DataError, match=place):
        pool_catalog(change(catalog()), by=by)


def test_people_of_two_studies_are_named() -> None:
    table = catalog().assign(person="")
    table.loc[[0, 5], "person"] = "X17"
    assert any("X17" in note for note in pool_catalog(table).notes)


def test_a_pool_comes_back_whole_and_can_be_drawn() -> None:
    table = pd.concat([catalog(), printed_rows(), rows("lab-d", [9.0])], ignore_index=True)
    pool = pool_catalog(table, with_printed=True)
    assert CollectionPool.from_dict(json.loads(json.dumps(pool.to_dict()))) == pool
    labels = [text.get_text() for text in pool_catalog(catalog()).plot().get_yticklabels()]
    assert labels == ["lab-a (4)", "lab-b (3)", "lab-c (5)", "mean over studies"]
    nothing = pool_catalog(rows("lab-a", LABS["lab-a"])).plot()
    assert nothing.get_title() == "nothing was pooled"


@dataclass
class Analysed:
    """What stands for an analysis of a study folder."""

    table: pd.DataFrame

    def to_frame(self) -> pd.DataFrame:
        """Return its estimates."""
        return self.table.assign(session="", side="")

    def covariance_frame(self) -> pd.DataFrame:
        """Return what is known of a variance."""
        return pd.DataFrame(
            [("P0", "MST", "stiffness", 4.0, 0.0, 0.0, "", "")], columns=list(COVARIANCE_COLUMNS)
        )


@dataclass
class Opened:
    """What stands for a study that was opened."""

    root: Path
    sha256: str = "ab" * 32


ONE = RawStudy(("level",))


@pytest.fixture
def analysed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Path, str, int]]:
    """Stand-ins for opening and analysing a study; the list holds what was analysed."""
    asked: list[tuple[Path, str, int]] = []

    def open_study(path: Path) -> Opened:
        if path.name == "gone":
            raise DataError("gone/study.toml: is not there.")
        return Opened(path)

    def analyze(study: Opened, *, method: str, seed: int) -> Analysed:
        if study.root.name == "bench":
            raise ValueError("method: dissertation is for another study.")
        asked.append((study.root, method, seed))
        own = rows("", [50.0, 60.0, 99.0], method=method)
        names = ["participant", "timing_point", "onset_gait_pct", "parameter", "value", "unit"]
        names += ["ci_low", "ci_high", "ci_level", "vaf_pct", "n_used", "n_excluded"]
        made = own[[*names, "method", "status"]].assign(onset_gait_pct=[21.5, 98.0, np.nan])
        return Analysed(made.assign(participant=["P0", "P2", "a person who is not in the entry"]))

    monkeypatch.setattr("jointz.io.study_reader.open_study", open_study)
    monkeypatch.setattr("jointz.analysis.analyze.analyze", analyze)
    return asked


def test_raw_data_are_analysed_again_by_one_method(
    analysed: list[tuple[Path, str, int]], tmp_path: Path
) -> None:
    parts = [rows("lab-a", LABS["lab-a"], raw_study="lab-a/raw", mass_kg=70.0)]
    parts += [rows("lab-b", LABS["lab-b"]), rows("lab-c", [60.0], raw_study="c"), printed_rows()]
    parts += [rows("lab-e", LABS["lab-b"], raw_study="gone")]
    parts += [rows("lab-f", LABS["lab-b"], raw_study="other")]
    parts += [rows("lab-g", LABS["lab-b"], raw_study="bench")]
    raw = dict.fromkeys(("lab-b", "lab-e", "lab-g"), ONE)
    raw |= {"lab-a": RawStudy(("level",), "AB" * 32), "lab-c": RawStudy(("level", "fast"))}
    raw |= {"lab-f": RawStudy(("level",), "cd" * 32)}
    table = pd.concat(parts, ignore_index=True)
    steps: list[str] = []
    made, notes = reanalysed(
        table, "dissertation", collection=tmp_path, raw=raw, seed=3,
        progress=lambda done, of, name: steps.append(f"{done}/{of} {name}"),
    )  # fmt: skip
    assert analysed == [(tmp_path / "lab-a/raw", "dissertation", 3)]
    own = made[made["values"] == "estimates"]
    assert own["participant"].tolist() == ["P0", "P2"]
    assert own["with_stiffness"].tolist() == pytest.approx([4.0, np.nan], nan_ok=True)
    assert set(own["method"]) == {"dissertation"}
    assert set(own["study"]) == {"lab-a"}
    assert set(own["mass_kg"]) == {70.0}
    assert made.columns.tolist() == list(CATALOG_COLUMNS)
    assert (made["values"] == "printed").sum() == 1
    assert [note.partition(": left out")[0] for note in notes] == [
        "lab-a", "lab-b", "lab-c", "lab-e", "lab-f", "lab-g",
    ]  # fmt: skip
    assert "P1, P3" in notes[0]
    assert "SHA-256" in notes[4]
    assert steps[:2] == ["0/6 lab-a", "1/6 lab-b"]
    assert only(pool_catalog(made))["status"] == "one_study"


def test_an_entry_whose_people_the_raw_data_do_not_hold_is_named(
    analysed: list[tuple[Path, str, int]], tmp_path: Path
) -> None:
    table = rows("lab-a", LABS["lab-b"], raw_study="raw").assign(participant=["S1", "S2", "S3"])
    made, notes = reanalysed(table, "dissertation", collection=tmp_path, raw={"lab-a": ONE})
    assert len(analysed) == 1
    assert made.empty
    assert [note.partition(": left out")[0] for note in notes] == ["lab-a"]


@pytest.mark.parametrize(
    ("phase", "people"),
    [((15.0, 30.0), ["P0"]), ((90.0, 10.0), ["P2"])],
)
def test_new_estimates_are_of_the_phases_that_are_asked_for(
    analysed: list[tuple[Path, str, int]], tmp_path: Path, phase: Any, people: list[str]
) -> None:
    table = rows("lab-a", [60.0, 61.0, 62.0], raw_study="raw")
    table["participant"] = ["P0", "P2", "a person who is not in the entry"]
    made, notes = reanalysed(
        table, "dissertation", collection=tmp_path, raw={"lab-a": ONE}, phase_pct=phase
    )
    assert made["participant"].tolist() == people
    assert len(notes) == 1


def test_a_method_that_there_is_not_is_refused_before_anything_is_analysed(
    analysed: list[tuple[Path, str, int]], tmp_path: Path
) -> None:
    with pytest.raises(DataError, match=r"reanalyse: method: "):
        reanalysed(catalog(raw_study="raw"), "foo", collection=tmp_path, raw={})
    assert not analysed


@pytest.mark.slow
def test_a_study_is_opened_and_analysed_again_where_it_is_the_one_vouched_for(
    small_study_source: Path, tmp_path: Path
) -> None:
    pytest.importorskip("duckdb")
    study = tmp_path / "raw"
    shutil.copytree(small_study_source, study)
    opened = open_study(study)

    def of_study(spec: dict[str, Any], tables: dict[str, pd.DataFrame]) -> None:
        ids = [person.id for person in opened.spec.participants]
        for person, own in zip(spec["participants"], ids, strict=True):
            for table in tables.values():
                table["participant"] = table["participant"].replace(person["id"], own)
            person["id"] = own
        spec["raw_data"] = {"where": "here", "study": "../../raw", "sha256": opened.sha256}

    write_entry(tmp_path / "collection" / "lab", seed=1, people=2, change=of_study)
    build_catalog(tmp_path / "collection", out=tmp_path / "catalog.parquet")
    where = CatalogFilter(parameter=("stiffness",), phase_pct=(0.0, 50.0))
    rules = PoolRules(reanalyse="dissertation")
    pool = pool_collection(tmp_path / "catalog.parquet", where=where, rules=rules)

    again = analyze(opened, method="dissertation").to_frame()
    again = again[(again["parameter"] == "stiffness") & (again["onset_gait_pct"] <= 50.0)]
    means = again.groupby("timing_point")["value"].mean()
    found = pool.table.set_index("timing_point")["value"]
    assert found.to_dict() == pytest.approx(means.to_dict())
    assert set(pool.table["methods"]) == {"dissertation"}

    with (study / "study.toml").open("a") as stream:
        stream.write("# another study by now\n")
    with pytest.raises(DataError, match="not the one of the entry"):
        pool_collection(tmp_path / "catalog.parquet", where=where, rules=rules)


@pytest.mark.slow
def test_pooled_intervals_hold_the_truth_of_people_labs_and_gains_as_often_as_they_say() -> None:
    n, held = 150, []
    for seed in range(n):
        table = pool_catalog(simulated(6, 6, seed)).table
        truth = table["parameter"].map({"stiffness": 60.0, "damping": 1.5, "inertia": 0.2})
        held.append(((table["ci_low"] <= truth) & (table["ci_high"] >= truth)).mean())
    assert 0.93 <= np.mean(held) <= 0.99
