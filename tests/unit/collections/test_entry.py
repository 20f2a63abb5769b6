"""A draft of an entry out of a results folder."""

import json
import tomllib

import pytest
from benchmarks.collection_entries import write_entry

from jointz.collections.checking.check_collection import check_entry
from jointz.collections.entry import make_entry
from jointz.core.errors import DataError, OutputError

FILLED = {
    "title": '"The knees of fictional people"', "licence": '"CC0-1.0"', "cite": '"A. Fictional"',
    "protocol": '"walking"', "contributors": '[{ name = "A. Fictional" }]',
    "approval": '"none needed: nobody was measured"', "consent": '"public"',
    "age_band": '"20-29"', "sex": '"not_stated"', "name": '"fictional"', "surface": '"treadmill"',
    "walking_speed_m_s": "1.2", "slope_deg": "0.0", "where": '"nowhere"', "side": '"left"',
    "torque": '"load_cell"', "note": '"none"',
}  # fmt: skip


@pytest.fixture
def results(tmp_path):
    """What an analysis leaves, as far as an entry needs it."""
    write_entry(tmp_path / "made", seed=8, people=2)
    folder = tmp_path / "results"
    folder.mkdir()
    (tmp_path / "made" / "estimates.csv").rename(folder / "estimates.csv")
    people = tomllib.loads((tmp_path / "made" / "entry.toml").read_text())["participants"]
    gain = {"torque_gain": {"value": 1.0, "sd": 0.02}}
    lags = [{"angle_lag_s": {"value": lag, "sd": 0.001}} for lag in (0.005, 0.006)]
    spec = {
        "joint": "knee", "kind": "walking", "positive": "flexion",
        "channels": {"angle": {}, "current": {}},
        "torque_model": {"gear_ratio": 9.0, "torque_constant": 0.11},
        "calibration": gain,
        "participants": [
            {"id": p["id"], "mass_kg": p["mass_kg"], "calibration": lag}
            for p, lag in zip(people, lags, strict=True)
        ],
        "recordings": [
            {"participant": p["id"], "file": file} for p in people for file in ("x.nc", "y.nc")
        ],
    }  # fmt: skip
    settings = {"method": "rigid", "window_s": 0.1, "cutoff_hz": 20.0, "seed": 1}
    provenance = {"jointz": "0.1.0", "study": spec, "settings": settings, "study_sha256": "ab"}
    (folder / "provenance.json").write_text(json.dumps(provenance))
    lines = ["participant,recording,onset_s,timing_point,kind,code,detail"]
    lines += ["S001,x,1.0,LRE,pulse,gap,", "S001,x,2.0,LRE,pulse,gap,", "S002,x,3.0,,stride,gap,"]
    (folder / "excluded.csv").write_text("\n".join(lines) + "\n")
    return folder


def changed(results, change):
    """Change what the provenance says of the study."""
    file = results / "provenance.json"
    provenance = json.loads(file.read_text())
    change(provenance["study"])
    file.write_text(json.dumps(provenance))


def drafted(results, tmp_path):
    file = make_entry(results, out=tmp_path / "lab", study_id="lab")
    return tomllib.loads(file.read_text())


def test_what_results_know_is_filled_in(results, tmp_path):
    file = make_entry(results, out=tmp_path / "lab", study_id="lab", study="../study")

    content = tomllib.loads(file.read_text())
    assert content["joint"] == {"name": "knee", "positive": "flexion"}
    assert content["device"]["torque"] == "motor_current"
    assert content["calibration"] == {"torque_gain": {"value": 1.0, "sd": 0.02}}
    assert content["exclusions"] == [
        {"kind": "pulse", "n": 2, "reason": "gap"}, {"kind": "stride", "n": 1, "reason": "gap"}
    ]  # fmt: skip
    assert content["method"]["name"] == "rigid"
    assert content["raw_data"] == {"study": "../study", "sha256": "ab"}


@pytest.mark.parametrize("in_which", [(0,), (0, 1, 2, 3)])
def test_a_calibration_of_recordings_is_one_of_the_entry_where_all_have_it(
    results, tmp_path, in_which
):
    own = {"torque_gain": {"value": 1.1, "sd": 0.05}}

    def calibrate(study):
        for k in in_which:
            study["recordings"][k]["calibration"] = own

    changed(results, calibrate)

    expected = own if len(in_which) == 4 else {}
    assert drafted(results, tmp_path).get("calibration", {}) == expected


def test_what_only_the_lab_knows_is_left_open_and_named(results, tmp_path):
    make_entry(results, out=tmp_path / "lab", study_id="lab")

    findings = check_entry(tmp_path / "lab").findings

    assert {finding.code for finding in findings} == {"key_missing"}
    assert {finding.where for finding in findings} >= {
        "licence", "ethics.consent", "cite", "joint.side", "participants[2].age_band",
        "conditions[1].walking_speed_m_s",
    }  # fmt: skip


def test_a_draft_that_is_filled_in_has_no_problem(results, tmp_path):
    file = make_entry(results, out=tmp_path / "lab", study_id="lab")
    lines = []
    for line in file.read_text().splitlines():
        key = line.removeprefix("# ").partition(" =")[0]
        lines.append(f"{key} = {FILLED[key]}" if line.startswith("# ") else line)
    file.write_text("\n".join(lines) + "\n")

    assert check_entry(tmp_path / "lab").findings == ()


def test_covariances_of_the_results_go_with_them(results, tmp_path):
    (tmp_path / "made" / "covariance.csv").rename(results / "covariance.csv")

    content = drafted(results, tmp_path)

    assert content["conditions"][0]["covariance"] == "covariance.csv"
    assert set(content["hashes"]) == {"estimates.csv", "covariance.csv"}
    assert (tmp_path / "lab" / "covariance.csv").is_file()


def test_an_id_that_is_none_is_refused_before_anything_is_written(results, tmp_path):
    with pytest.raises(DataError, match="'our knees'"):
        make_entry(results, out=tmp_path / "Our Knees", study_id="our knees")
    assert not (tmp_path / "Our Knees").exists()


def test_a_side_that_the_study_tells_is_not_asked_again(results, tmp_path):
    def take_sides(study):
        for recording in study["recordings"]:
            recording["side"] = {"S001": "left", "S002": "right"}[recording["participant"]]

    changed(results, take_sides)

    content = drafted(results, tmp_path)
    assert content["joint"]["side"] == "both"
    assert [p["side"] for p in content["participants"]] == ["left", "right"]


def test_results_of_a_bench_are_refused(results, tmp_path):
    changed(results, lambda study: study.update(kind="bench"))

    with pytest.raises(DataError):
        make_entry(results, out=tmp_path / "lab", study_id="lab")
    assert not (tmp_path / "lab").exists()


def test_a_folder_without_results_is_refused_and_an_entry_is_kept(results, tmp_path):
    with pytest.raises(DataError):
        make_entry(tmp_path, out=tmp_path / "lab", study_id="lab")

    make_entry(results, out=tmp_path / "lab", study_id="lab")
    with pytest.raises(OutputError):
        make_entry(results, out=tmp_path / "lab", study_id="lab")
