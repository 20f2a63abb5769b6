"""Files into other formats, studies into BIDS, and what is refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.unit.io.same_content import is_same_content

from jointz.conversion.convert import convert
from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError, OutputError, WriteError
from jointz.io.bids.bids_read import read_bids
from jointz.io.formats.registry import read_acquisition, write_acquisition
from jointz.io.study_reader import open_study


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A csv file with a clock and an angle in degrees."""
    path = tmp_path / "walk.csv"
    path.write_text("time_s,knee [deg]\n0,1.5\n0.01,2.5\n0.02,NaN\n")
    return path


@pytest.mark.parametrize("name", ["a.nc", "a.tsv", "a.txt.gz"])
def test_a_table_goes_into_every_format_with_its_numbers(tmp_path, walk, name):
    made = convert(walk, tmp_path / name)

    assert made.left_out == ()
    assert made.to_dict()["target"] == str(tmp_path / name)
    assert is_same_content(read_acquisition(tmp_path / name), read_acquisition(walk))


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
    shown = jointz("convert", source, tmp_path / "b.nc")
    assert shown.code == 0
    assert "100 Hz" in shown.out


def test_a_file_that_exists_is_kept(tmp_path, walk):
    (tmp_path / "a.nc").write_bytes(b"mine")

    with pytest.raises(OutputError):
        convert(walk, tmp_path / "a.nc")
    assert (tmp_path / "a.nc").read_bytes() == b"mine"

    with pytest.raises(OutputError):
        convert(walk, walk, overwrite=True)
    convert(walk, tmp_path / "a.nc", overwrite=True)
    assert read_acquisition(tmp_path / "a.nc").groups[0].n_samples == 3


def test_targets_that_cannot_be_are_told_before_anything_is_read(tmp_path, walk, small_study):
    with pytest.raises(DataError, match=r"a\.docx: no format"):
        convert(walk, tmp_path / "a.docx")
    with pytest.raises(WriteError):
        convert(walk, tmp_path / "nowhere" / "a.nc")
    (tmp_path / "a.nc").mkdir()
    with pytest.raises(OutputError):
        convert(walk, tmp_path / "a.nc")
    with pytest.raises(DataError, match=r"study\.toml.*dataset_description"):
        convert(tmp_path / "a.nc", tmp_path / "b.nc")
    for source in (small_study.root, small_study.root / "study.toml"):
        with pytest.raises(DataError, match=r"a BIDS folder \(--to bids\)"):
            convert(source, tmp_path / "a.mat")


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

    made = convert(tmp_path, tmp_path / "bids", to="bids")

    assert len(made.notes) == 1
    (content,) = read_bids(tmp_path / "bids").values()
    assert [event.time_s for event in content.events] == [1.0]


def test_a_study_goes_as_bids_and_comes_back_as_one_file_with_its_signs(tmp_path, small_study):
    small_study.edit_toml('[channels.angle]\ncolumn = "angle"\nunit = "rad"', ANGLE, 1)
    study = open_study(small_study.root)
    for spec in study.spec.recordings:
        small_study.edit_table(spec.file, lambda t: t.head(3000))
    convert(small_study.root, tmp_path / "bids", to="bids")

    made = convert(tmp_path / "bids", tmp_path / "bids.nc")

    n_recordings = len(study.spec.recordings)
    assert len(read_acquisition(tmp_path / "bids.nc").groups) == n_recordings
    assert len(made.content) == n_recordings
    with pytest.raises(DataError, match="made of a study"):
        convert(tmp_path / "bids.nc", tmp_path / "again", to="bids")
    signs = read_acquisition(tmp_path / "bids.nc").metadata
    assert {signs[k] for k in signs if k.endswith(("positive.angle", "positive.torque"))} == {
        "flexion"
    }


def test_events_of_an_unknown_length_are_written(tmp_path):
    motion = tmp_path / "bids" / "sub-1" / "motion"
    motion.mkdir(parents=True)
    stem = "sub-1_task-w_tracksys-imu"
    (tmp_path / "bids" / "dataset_description.json").write_text("{}")
    (motion / f"{stem}_motion.json").write_text('{"SamplingFrequency": 100}')
    (motion / f"{stem}_channels.tsv").write_text("name\ttype\tunits\nknee\tJNTANG\tdeg\n")
    (motion / f"{stem}_motion.tsv").write_text("1\n2\n3\n")
    (motion / f"{stem}_events.tsv").write_text("onset\tduration\n0.01\tn/a\n")

    convert(tmp_path / "bids", tmp_path / "a.nc")

    (event,) = read_acquisition(tmp_path / "a.nc").events
    assert np.isnan(event.duration_s)


def test_the_layout_of_a_text_file_can_be_told(tmp_path, jointz):
    (tmp_path / "a.txt").write_text("by hand\nknee;hip\n1,5;2\n2,5;3\n")
    options = ("--delimiter", ";", "--decimal", ",", "--skip-rows", 1)

    assert jointz("convert", tmp_path / "a.txt", tmp_path / "a.csv", *options).code == 0

    table = pd.read_csv(tmp_path / "a.csv")
    assert table.to_dict("list") == {"knee": [1.5, 2.5], "hip": [2.0, 3.0]}
