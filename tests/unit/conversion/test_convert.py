"""Files into other formats, studies into one file, and what is refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

from jointz.conversion.convert import convert
from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError, OutputError, WriteError
from jointz.io.formats.registry import read_acquisition, write_acquisition
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A csv file with a clock and an angle in degrees."""
    path = tmp_path / "walk.csv"
    path.write_text("time_s,knee [deg]\n0,1.5\n0.01,2.5\n0.02,NaN\n")
    return path


@pytest.mark.parametrize("name", ["a.mat", "a.nc", "a.parquet", "a.tsv"])
def test_a_table_goes_into_every_format_with_its_numbers(tmp_path, walk, name):
    made = convert(walk, tmp_path / name)

    assert made.left_out == ()
    assert made.to_dict()["target"] == str(tmp_path / name)
    assert read_acquisition(tmp_path / name).equals(read_acquisition(walk))


@pytest.mark.parametrize(("name", "column"), [("a.xlsx", "knee [deg]"), ("a.sto", "knee_[deg]")])
def test_a_table_goes_into_files_that_call_it_otherwise(tmp_path, walk, name, column):
    convert(walk, tmp_path / name, lossy=name == "a.sto")

    (group,), (whole,) = read_acquisition(tmp_path / name).groups, read_acquisition(walk).groups
    np.testing.assert_array_equal(group.times_s(), whole.times_s())
    assert [s.name for s in group.signals] == [column]
    np.testing.assert_array_equal(group.signals[0].values, whole.signals[0].values)


def rich(path: Path) -> Path:
    group = SignalGroup("points", (Signal("knee", np.arange(3.0), "deg"),), 100.0)
    write_acquisition(Acquisition((group,), (Event(0.0, "HS"),)), path)
    return path


def test_what_does_not_fit_is_named_and_left_out_only_with_leave(tmp_path, jointz):
    source, target = rich(tmp_path / "a.nc"), tmp_path / "b.csv"

    with pytest.raises(DataError, match=r"b\.csv: .*events"):
        convert(source, target)
    refused = jointz("convert", source, target)
    assert (refused.code, "events" in refused.err) == (2, True)
    assert not target.exists()

    made = convert(source, target, lossy=True)
    assert len(made.left_out) == 1
    assert target.read_text().startswith("time [s],knee [deg]\n0.0,0.0\n")
    lossy = jointz("convert", source, target, "--lossy", "--overwrite", "--json").json
    assert (lossy["status"], lossy["left_out"]) == ("ok", list(made.left_out))
    silent = jointz("convert", source, target, "--lossy", "--overwrite", "--quiet")
    assert (silent.code, silent.out) == (0, "")
    shown = jointz("convert", source, tmp_path / "a.mat")
    assert shown.code == 0
    assert "100 Hz" in shown.out


def test_a_file_that_exists_is_kept(tmp_path, walk):
    (tmp_path / "a.mat").write_bytes(b"mine")

    with pytest.raises(OutputError):
        convert(walk, tmp_path / "a.mat")
    assert (tmp_path / "a.mat").read_bytes() == b"mine"

    with pytest.raises(OutputError):
        convert(walk, walk, overwrite=True)
    convert(walk, tmp_path / "a.mat", overwrite=True)
    assert read_acquisition(tmp_path / "a.mat").groups[0].n_samples == 3


def test_no_recording_of_a_study_is_replaced(tmp_path, small_study):
    inside = small_study.root / "more.mat"
    convert(small_study.root, inside)
    before = {p.name: p.read_bytes() for p in small_study.root.iterdir()}
    outside = (small_study.root / "S01_perturbed.csv").rename(tmp_path / "a.mat")
    small_study.edit_toml("S01_perturbed.csv", "../a.mat")
    outside.write_bytes(before["S01_perturbed.csv"])

    for source in (small_study.root, small_study.root / "study.toml"):
        with pytest.raises(OutputError, match=r"more\.mat: "):
            convert(source, inside, overwrite=True)
    (tmp_path / "a.mat").unlink()
    scipy.io.savemat(tmp_path / "a.mat", {name: np.zeros(3) for name in COLUMNS})
    kept = (tmp_path / "a.mat").read_bytes()
    with pytest.raises(OutputError, match=r"a\.mat: "):
        convert(small_study.root, tmp_path / "a.mat", overwrite=True)

    assert (tmp_path / "a.mat").read_bytes() == kept
    assert inside.read_bytes() == before["more.mat"]


COLUMNS = ("time", "angle", "torque", "command", "contact")


def test_targets_that_cannot_be_are_told_before_anything_is_read(tmp_path, walk, small_study):
    with pytest.raises(DataError, match=r"a\.docx: no format"):
        convert(walk, tmp_path / "a.docx")
    with pytest.raises(WriteError):
        convert(walk, tmp_path / "nowhere" / "a.mat")
    (tmp_path / "a.mat").mkdir()
    with pytest.raises(OutputError):
        convert(walk, tmp_path / "a.mat")
    with pytest.raises(DataError, match=r"study\.toml.*dataset_description"):
        convert(tmp_path / "a.mat", tmp_path / "b.mat")
    with pytest.raises(DataError, match=r"\.mat file or a BIDS folder"):
        convert(small_study.root, tmp_path / "a.csv")


def test_a_study_becomes_one_struct_in_si_and_in_its_directions(tmp_path, small_study):
    small_study.edit_toml('[channels.angle]\ncolumn = "angle"\nunit = "rad"', ANGLE, 1)

    made = convert(small_study.root, tmp_path / "study.mat")

    found = scipy.io.loadmat(tmp_path / "study.mat", simplify_cells=True)["jointz"]
    assert (found["joint"], found["positive"]) == ("knee", "flexion")
    assert [person["id"] for person in found["participants"]] == ["S01", "S02"]
    assert found["study_toml"] == small_study.toml
    study = open_study(small_study.root)
    for own, entry in zip(found["recordings"], study.spec.recordings, strict=True):
        (recording,) = read_recording(study, entry)
        angle = own["signals"]["angle"]
        assert (own["participant"], own["condition"]) == (entry.participant, entry.condition)
        assert (angle["unit"], angle["positive"]) == ("rad", "flexion")
        np.testing.assert_array_equal(angle["values"], recording["angle"])
        np.testing.assert_array_equal(own["time"], recording["time"])
    assert len(made.content) == len(study.spec.recordings)
    perturbed = [r for r in found["recordings"] if r["condition"] == "perturbed"]
    assert perturbed
    for own in perturbed:
        pulses = own["pulses"]
        command = own["signals"]["command"]["values"]
        at = np.searchsorted(own["time"], pulses["onset_s"])
        assert len(at) == 6 * 4  # timing points, pulses at each
        assert (command[at] != 0).all()
        assert (np.sign(command[at]) == np.sign(pulses["amplitude"])).all()

    content = read_acquisition(tmp_path / "study.mat")  # which is read again

    group, (recording,) = content.groups[0], read_recording(study, study.spec.recordings[0])
    np.testing.assert_array_equal(group.time_s, recording["time"])
    assert [signal.name for signal in group.signals] == [str(n) for n in recording.data_vars]
    assert any(g.name.endswith(".pulses") for g in content.groups)
    assert content.metadata["positive"] == "flexion"


ANGLE = '[channels.angle]\ncolumn = "angle"\nunit = "deg"\npositive = "extension"'


def test_pulses_of_a_table_outside_the_samples_are_told(tmp_path):
    rows = "".join(f"{k / 100},{k % 7},{k % 3}\n" for k in range(300))
    (tmp_path / "a.csv").write_text(f"t,a,m\n{rows}")
    (tmp_path / "pulses.csv").write_text("onset_s,amplitude_nm\n-1,5\n1,5\n99,5\n")
    (tmp_path / "study.toml").write_text(
        'jointz = 1\njoint = "knee"\nkind = "bench"\n[channels]\ntime.column = "t"\n'
        'angle.column = "a"\ntorque.column = "m"\n[[participants]]\nid = "S01"\n'
        '[[recordings]]\nparticipant = "S01"\nfile = "a.csv"\ncondition = "perturbed"\n'
        'perturbations = "pulses.csv"\n'
    )

    into_matlab = convert(tmp_path, tmp_path / "a.mat")
    into_bids = convert(tmp_path, tmp_path / "bids", to="bids")

    assert into_matlab.notes == into_bids.notes
    assert len(into_bids.notes) == 1
    pulses = scipy.io.loadmat(tmp_path / "a.mat", simplify_cells=True)["jointz"]["recordings"]
    assert pulses["pulses"]["onset_s"] == 1.0


def test_a_study_goes_as_bids_and_comes_back_as_one_file_with_its_signs(tmp_path, small_study):
    small_study.edit_toml('[channels.angle]\ncolumn = "angle"\nunit = "rad"', ANGLE, 1)
    study = open_study(small_study.root)
    for spec in study.spec.recordings:
        small_study.edit_table(spec.file, lambda t: t.head(3000))
    convert(small_study.root, tmp_path / "bids", to="bids")

    made = convert(tmp_path / "bids", tmp_path / "bids.nc")
    convert(tmp_path / "bids", tmp_path / "bids.mat")

    n_recordings = len(study.spec.recordings)
    assert len(read_acquisition(tmp_path / "bids.nc").groups) == n_recordings
    assert len(made.content) == n_recordings
    with pytest.raises(DataError, match="made of a study"):
        convert(tmp_path / "bids.nc", tmp_path / "again", to="bids")
    found = scipy.io.loadmat(tmp_path / "bids.mat", simplify_cells=True)["jointz"]["groups"]
    for group in found.values():
        positive = {name: s["positive"] for name, s in group["signals"].items()}
        assert positive["angle"] == positive["torque"] == "flexion"
        assert len(positive["contact"]) == 0


def test_events_of_an_unknown_length_go_into_every_format(tmp_path):
    motion = tmp_path / "bids" / "sub-1" / "motion"
    motion.mkdir(parents=True)
    stem = "sub-1_task-w_tracksys-imu"
    (tmp_path / "bids" / "dataset_description.json").write_text("{}")
    (motion / f"{stem}_motion.json").write_text('{"SamplingFrequency": 100}')
    (motion / f"{stem}_channels.tsv").write_text("name\ttype\tunits\nknee\tJNTANG\tdeg\n")
    (motion / f"{stem}_motion.tsv").write_text("1\n2\n3\n")
    (motion / f"{stem}_events.tsv").write_text("onset\tduration\n0.01\tn/a\n")

    for name in ("a.nc", "a.mat", "a.parquet"):
        made = convert(tmp_path / "bids", tmp_path / name, lossy=True)
        (event,) = read_acquisition(tmp_path / name).events
        assert np.isnan(event.duration_s), (name, made.left_out)


def test_the_layout_of_a_text_file_can_be_told(tmp_path, jointz):
    (tmp_path / "a.txt").write_text("by hand\nknee;hip\n1,5;2\n2,5;3\n")
    options = ("--delimiter", ";", "--decimal", ",", "--skip-rows", 1)

    assert jointz("convert", tmp_path / "a.txt", tmp_path / "a.csv", *options).code == 0

    table = pd.read_csv(tmp_path / "a.csv")
    assert table.to_dict("list") == {"knee": [1.5, 2.5], "hip": [2.0, 3.0]}
