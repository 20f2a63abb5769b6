"""Motion-BIDS folders: damaged ones, and those of others."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jointz.core.errors import DataError
from jointz.io.bids.bids_read import read_bids
from jointz.io.bids.bids_write import MotionChannel, MotionRecording, write_motion

STEM = "sub-01_task-walking_tracksys-imu"


def foreign(root: Path, **files: str) -> Path:
    """A dataset that jointz did not write: sidecars above, a latency channel, events."""
    texts = {
        "dataset_description.json": '{"Name": "a", "BIDSVersion": "1.9.0"}',
        "participants.tsv": "participant_id\tage\tsex\nsub-01\t31\tn/a\n",
        "task-walking_tracksys-imu_motion.json": '{"SamplingFrequency": 100, "TaskName": "w"}',
        f"sub-01/motion/{STEM}_channels.tsv": (
            "name\tcomponent\ttype\ttracked_point\tunits\nt\tn/a\tLATENCY\tn/a\ts\n"
            "knee\tn/a\tJNTANG\tknee\tdeg\nacc\tx\tACCEL\tshank\tm/s^2\n"
        ),
        f"sub-01/motion/{STEM}_motion.tsv": (
            "0.000000\t1.5\t9.81\n0.010000\tn/a\t9.8\n0.020000\t1e-3\t-0.0\n"
        ),
        f"sub-01/motion/{STEM}_events.tsv": (
            "onset\tduration\ttrial_type\tspeed\n0.01\tn/a\tstep\t1.2\n0.005\t0.1\tstart\tn/a\n"
        ),
    } | {name.replace("__", "/").replace("STEM", STEM): text for name, text in files.items()}
    for name, text in texts.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def test_a_foreign_dataset_is_read_as_it_stands(tmp_path):
    (content,) = read_bids(foreign(tmp_path)).values()

    (group,) = content.groups
    assert [(s.name, s.unit) for s in group.signals] == [("knee", "deg"), ("acc", "m/s^2")]
    np.testing.assert_array_equal(group.time_s, [0.0, 0.01, 0.02])
    np.testing.assert_array_equal(group.signals[0].values, [1.5, np.nan, 1e-3])
    assert [(e.time_s, e.label) for e in content.events] == [
        (0.005, "start"),
        (0.01, "step speed=1.2"),
    ]
    np.testing.assert_array_equal([e.duration_s for e in content.events], [0.1, np.nan])
    assert content.metadata["subject.age"] == "31"
    assert content.metadata["bids.file"] == f"{STEM}_motion.tsv"


def test_one_recording_is_read_by_its_name(tmp_path):
    root = foreign(tmp_path)

    assert list(read_bids(root, recording=f"{STEM}_motion.tsv")) == [STEM]
    with pytest.raises(DataError, match=f"no recording 'sub-02'.*it has: {STEM}"):
        read_bids(root, recording="sub-02")


def test_the_nearest_sidecar_stands_over_the_others(tmp_path):
    near = {f"sub-01/motion/{STEM}_motion.json": '{"SamplingFrequency": 250.5}'}
    root = changed(foreign(tmp_path, **near), "channels.tsv", "LATENCY", "MISC")

    (content,) = read_bids(root).values()

    assert content.groups[0].rate_hz == 250.5
    assert content.metadata["sidecar.TaskName"] == "w"


def test_of_sidecars_in_one_folder_the_one_for_fewer_recordings_stands_over_the_others(tmp_path):
    general = {"tracksys-imu_motion.json": '{"SamplingFrequency": 40, "Manufacturer": "m"}'}
    root = changed(foreign(tmp_path, **general), "channels.tsv", "LATENCY", "MISC")

    (content,) = read_bids(root).values()

    assert content.groups[0].rate_hz == 100.0
    assert content.metadata["sidecar.Manufacturer"] == "m"


def reading(root: Path, key: str) -> tuple[float | None, str]:
    """The rate of the one recording, and what its reader noted under a key."""
    (content,) = read_bids(root).values()
    return content.groups[0].rate_hz, content.metadata.get(f"reading.{key}", "")


def changed(root: Path, ending: str, old: str, new: str) -> Path:
    path = root / f"sub-01/motion/{STEM}_{ending}"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    return root


def test_the_effective_rate_of_others_is_the_clock(tmp_path):
    sidecar = '{"SamplingFrequency": 100, "SamplingFrequencyEffective": 98.5}'
    root = foreign(tmp_path, **{"task-walking_tracksys-imu_motion.json": sidecar})
    changed(root, "channels.tsv", "LATENCY", "MISC")

    rate, note = reading(root, "rate")

    assert rate == 98.5
    assert note


@pytest.mark.parametrize(
    ("ending", "old", "new"),
    [
        ("channels.tsv", "n/a\ts\n", "n/a\tms\n"),
        ("motion.tsv", "0.020000", "0.005000"),
        ("channels.tsv", "ACCEL", "LATENCY"),
    ],
)
def test_a_latency_that_is_not_the_clock_is_told(ending, old, new, tmp_path):
    rate, note = reading(changed(foreign(tmp_path), ending, old, new), "clock")

    assert rate == 100.0
    assert note


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("motion.tsv", "9.81", "9,81", "row 1, column 3: "),
        ("motion.tsv", "\t9.8\n", "\n", "row 2: "),
        ("motion.tsv", "\t-0.0\n", "\t-0", "row 3: "),
        ("events.tsv", "start\tn/a\n", "start\tn/a", "row 3: "),
        ("channels.tsv", "m/s^2\n", "", "row 4: "),
        ("channels.tsv", "acc\tx\tACCEL\tshank\tm/s^2\n", "", "names 2 channels"),
        ("motion.tsv", "9.81", "inf", "row 1, column 3: "),
        ("channels.tsv", "units", "unit", "units"),
        ("channels.tsv", "acc", "knee", "'knee'"),
        ("events.tsv", "0.005", "soon", "row 3: column 'onset'"),
    ],
)
def test_damage_is_named_with_its_place(file, old, new, said, tmp_path):
    changed(foreign(tmp_path), file, old, new)

    with pytest.raises(DataError) as caught:
        read_bids(tmp_path)

    assert f"{STEM}_{file}" in str(caught.value)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("sidecar", "place"),
    [
        ("{", "_motion.json"),
        ("[1]", "_motion.json"),
        ('{"TaskName": "w"}', "SamplingFrequency"),
        *((f'{{"SamplingFrequency": {bad}}}', "SamplingFrequency") for bad in (-1, "true", "NaN")),
        ('{"SamplingFrequency": 100, "RecordingDuration": 60}', "6000 samples"),
    ],
)
def test_a_sidecar_that_cannot_be_trusted_is_refused(sidecar, place, tmp_path):
    root = foreign(tmp_path, **{"task-walking_tracksys-imu_motion.json": sidecar})

    with pytest.raises(DataError, match=place):
        read_bids(root)


@pytest.mark.parametrize(
    "missing",
    [
        "dataset_description.json",
        "task-walking_tracksys-imu_motion.json",
        f"sub-01/motion/{STEM}_channels.tsv",
        f"sub-01/motion/{STEM}_motion.tsv",
    ],
)
def test_a_missing_file_is_refused(missing, tmp_path):
    (foreign(tmp_path) / missing).unlink()

    with pytest.raises(DataError):
        read_bids(tmp_path)


def own(root: Path) -> Path:
    """A recording that jointz writes, with an uneven clock and pulses."""
    rng = np.random.default_rng(2)
    time = 3.7 + np.cumsum(0.001 + 1e-5 * rng.random(60))
    angle, torque = rng.standard_normal((2, 60))
    channels = (
        MotionChannel("angle", angle, "JNTANG", "rad", "knee", "Angle.", "flexion"),
        MotionChannel("torque", torque, "MISC", "N*m", "knee", "Torque.", "flexion"),
    )
    event = {"onset_s": 3.71, "duration_s": 0.02, "amplitude": -7.0, "timing_point": "LRE"}
    entities = {"sub": "01", "task": "walking", "tracksys": "knee"}
    write_motion(MotionRecording(entities, time, 1000.0, channels, events=(event,)), root)
    (root / "dataset_description.json").write_text('{"Name": "a", "BIDSVersion": "1.10.0"}')
    (root / "participants.tsv").write_text("participant_id\tmass_kg\nsub-01\t70.0\n")
    return root


@pytest.mark.parametrize("name", ["participants.tsv", f"sub-01/motion/{STEM}_channels.tsv"])
def test_a_table_that_an_editor_left_without_a_last_line_end_is_read_and_told(name, tmp_path):
    path = foreign(tmp_path) / name
    path.write_text(path.read_text().removesuffix("\n"))

    (content,) = read_bids(tmp_path).values()

    assert content.groups[0].n_samples == 3
    assert content.metadata["reading.end"].startswith(f"{path.name}: the last line has no end")


def test_events_whose_number_is_stated_need_no_last_line_end(tmp_path):
    (path,) = own(tmp_path).rglob("*_events.tsv")
    path.write_text(path.read_text().removesuffix("\n"))

    (content,) = read_bids(tmp_path).values()

    assert len(content.events) == 1
    assert content.metadata["reading.end"].startswith(f"{path.name}: the last line has no end")


def damaged_bytes(content: bytes, rng: np.random.Generator) -> bytes:
    """Cut a file off, or put bytes in that no such file holds."""
    at = int(rng.integers(0, max(len(content) - 1, 1)))
    if rng.random() < 0.5:
        return content[:at]
    junk = bytes([0xFF, 0xFE, *rng.integers(128, 255, 4).astype(np.uint8).tolist()])
    return content[:at] + junk + content[at:]


def test_damaged_datasets_end_in_an_error_or_a_note_that_names_file_and_cause(tmp_path):
    whole = own(tmp_path / "whole")
    files = [p.relative_to(whole) for p in sorted(whole.rglob("*")) if p.is_file()]
    # The data dictionary of events is not read; without it nothing changes.
    files = [f for f in files if not f.name.endswith("_events.json")]
    rng = np.random.default_rng(5)
    refused = 0
    for k in range(80):
        root = tmp_path / str(k)
        shutil.copytree(whole, root)
        file = files[k % len(files)]
        (root / file).write_bytes(damaged_bytes((whole / file).read_bytes(), rng))

        try:
            (content,) = read_bids(root).values()
        except DataError as exc:
            message, refused = str(exc), refused + 1
        else:  # cut off in the last cell of a table
            message = content.metadata["reading.end"]

        assert file.name in message
        assert len(message) > len(file.name) + 20
        shutil.rmtree(root)
    assert refused >= 72


numbers = st.floats(allow_nan=True, allow_infinity=False)


@given(
    values=st.lists(numbers, min_size=2, max_size=30),
    start=st.floats(-1e3, 1e3),
    rate=st.floats(1.0, 1e4),
    jitter=st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_reading_gives_back_what_was_written_bit_for_bit(
    tmp_path_factory, values, start, rate, jitter
):
    root = tmp_path_factory.mktemp("bids")
    steps = np.arange(len(values)) / rate
    time = start + steps * (1.1 if jitter else 1.0)
    if not (np.diff(time) > 0).all():
        return
    own(root)
    (root / "participants.tsv").write_text("participant_id\nsub-01\nsub-02\n")
    column = np.array(values)
    channel = MotionChannel("x", column, "MISC", "N*m", "knee", "About it.", "extension")
    entities = {"sub": "02", "task": "bench", "tracksys": "knee"}
    write_motion(MotionRecording(entities, time, rate, (channel,)), root)

    content = read_bids(root, recording="sub-02_task-bench_tracksys-knee")
    (group,) = content["sub-02_task-bench_tracksys-knee"].groups

    (signal,) = group.signals
    np.testing.assert_array_equal(signal.values, column)
    same_sign = np.signbit(signal.values) == np.signbit(column)
    assert same_sign[np.isfinite(column)].all()
    assert (signal.unit, signal.description) == ("N*m", "About it.")
    np.testing.assert_array_equal(group.times_s(), time)


def test_infinity_has_no_place_in_bids(tmp_path):
    values = np.array([0.0, np.inf, 1.0])
    channel = MotionChannel("torque", values, "MISC", "N*m", "knee", "")
    entities = {"sub": "01", "task": "walking", "tracksys": "knee"}
    recording = MotionRecording(entities, np.arange(3.0), 1.0, (channel,))

    with pytest.raises(DataError, match=r"channel 'torque', sample 2: .* infinity"):
        write_motion(recording, tmp_path)

    assert list(tmp_path.iterdir()) == []
