"""What jointz inspect finds in files as laboratories have them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.unit.io.foreign_files import write_file

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError, StudyError
from jointz.inspection.inspect_file import inspect_file
from jointz.io.formats.registry import write_acquisition
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study

from .answers import answered, open_keys

RATE_HZ = 200.0


def walking(n=2000, **columns) -> pd.DataFrame:
    """Strides of 1 s in degrees, with pulses on the command and a footswitch."""
    s = np.arange(n) / RATE_HZ
    angle = 30 * ((1 - np.cos(2 * np.pi * s)) / 2) ** 2
    pulses = 17.0 * ((s % 3 > 2) & (s % 3 < 2.2))
    rng = np.random.default_rng(3)
    return pd.DataFrame(
        {
            "Time (s)": s,
            "Knee angle": angle + 0.01 * rng.standard_normal(n),
            "Torque (Nm)": 3 * np.sin(4 * np.pi * s) + 0.01 * rng.standard_normal(n),
            "commanded torque (Nm)": pulses,
            "footswitch": (s % 1 < 0.6).astype(int),
        }
    ).assign(**columns)


def inspected(folder: Path, frame: pd.DataFrame, name="S07_walk.csv", **options):
    frame.to_csv(folder / name, index=False, **options)
    return inspect_file(folder / name)


def opened(folder: Path, found):
    (folder / "study.toml").write_text(answered(found.toml))
    study = open_study(folder)
    return study, [r for e in study.spec.recordings for r in read_recording(study, e)]


def test_a_plain_recording_of_walking_needs_no_edit(tmp_path):
    found = inspected(tmp_path, walking())

    assert found.obstacles == ()
    study, (recording,) = opened(tmp_path, found)
    assert study.spec.kind == "walking"
    assert study.spec.participants[0].id == "S07"
    assert study.spec.recordings[0].condition == "perturbed"
    assert float(recording["angle"].max()) == pytest.approx(np.deg2rad(30.0), abs=0.01)
    assert {"contact", "command", "torque"} <= set(recording)


def test_degrees_are_told_from_radians_by_their_range(tmp_path):
    degrees = inspected(tmp_path, walking()).channel("angle")
    small = walking()
    small["Knee angle"] = np.deg2rad(small["Knee angle"])
    radians = inspected(tmp_path, small).channel("angle")

    assert (degrees.unit, degrees.unit_is) == ("deg", "guessed")
    assert (radians.unit, radians.unit_is) == ("rad", "guessed")


def test_decimal_commas_and_a_header_of_six_lines_need_no_edit(tmp_path):
    frame = walking()
    body = frame.to_csv(index=False, sep=";", decimal=",")
    head = "Lab of gait\nS12; normal\n\nRate: 200 Hz\nfilter, none\n--\n"
    (tmp_path / "S12.csv").write_text(head + body)

    found = inspect_file(tmp_path / "S12.csv")

    _, (recording,) = opened(tmp_path, found)
    assert found.layout["skip_rows"] == 6
    assert recording.sizes["time"] == len(frame)


def test_trials_whose_time_begins_again_are_taken_by_their_column(tmp_path):
    frame = pd.concat([walking(600, trial=k) for k in (1, 2, 3)], ignore_index=True)

    found = inspected(tmp_path, frame)

    assert found.clocks[0].restarts == (600, 1200)
    assert found.obstacles == ()
    assert len(opened(tmp_path, found)[1]) == 3


def test_a_missing_stamp_moves_no_restart(tmp_path):
    frame = pd.concat([walking(600, trial=k) for k in (1, 2)], ignore_index=True)
    frame.loc[3, "Time (s)"] = np.nan

    assert inspected(tmp_path, frame).clocks[0].restarts == (600,)


def test_time_that_begins_again_without_a_column_of_trials_is_an_obstacle(tmp_path):
    found = inspected(tmp_path, pd.concat([walking(600)] * 2, ignore_index=True))

    (reason,) = found.obstacles
    assert "sample 601" in reason
    with pytest.raises(DataError, match="time goes back"):
        opened(tmp_path, found)


def test_a_column_of_conditions_gives_its_levels_a_meaning(tmp_path):
    half = np.repeat(["ENP", "EWP"], 1000)

    found = inspected(tmp_path, walking(condition=half))

    study, recordings = opened(tmp_path, found)
    levels = study.spec.channels["condition"].model_dump()["values"]
    assert levels == {"ENP": "unperturbed", "EWP": "perturbed"}
    assert [r.attrs["condition"] for r in recordings] == ["unperturbed", "perturbed"]


def test_gaps_jitter_and_missing_numbers_are_told_with_their_place(tmp_path):
    frame = walking()
    frame.loc[500:509, "Torque (Nm)"] = np.nan
    frame = frame.drop(index=range(1000, 1040)).reset_index(drop=True)

    found = inspected(tmp_path, frame)

    ((before, after),) = found.clocks[0].gaps
    assert (before, after) == pytest.approx((999 / RATE_HZ, 1040 / RATE_HZ))
    assert found.channel("torque").n_missing == 10


def test_saturated_constant_and_overflowing_columns_are_told(tmp_path):
    frame = walking(spare=1.5)
    frame["Torque (Nm)"] = frame["Torque (Nm)"].clip(upper=2.0)
    frame["motor current (A)"] = 1e6 * np.sin(np.arange(2000) / 7)

    found = inspected(tmp_path, frame)

    notes = {c.column: " ".join(c.notes) for c in found.channels}
    assert "saturated?" in notes["Torque (Nm)"]
    assert notes["spare"] == "constant at 1.5"
    assert "did the sensor overflow?" in notes["motor current (A)"]
    assert any("cannot be trusted" in reason for reason in found.obstacles)


def test_a_source_that_is_slower_than_the_file_is_told(tmp_path):
    frame = walking()
    frame["Torque (Nm)"] = frame["Torque (Nm)"].to_numpy()[np.arange(2000) // 4 * 4]

    notes = inspected(tmp_path, frame).channel("torque").notes

    assert any("gives a new one about every 4.0 samples" in note for note in notes)


def test_motion_without_pulses_does_not_tell_the_side_of_the_torque(tmp_path):
    rng = np.random.default_rng(1)
    s = np.arange(6000) / RATE_HZ
    noise = np.convolve(rng.standard_normal(s.size), np.hanning(21), "same")
    angle = 0.01 * noise
    velocity = np.gradient(angle) * RATE_HZ
    torque = -(60 * angle + velocity + 0.02 * np.gradient(velocity) * RATE_HZ)
    frame = pd.DataFrame({"t": s, "angle_rad": angle, "torque_nm": torque})

    found = inspected(tmp_path, frame, "bench.csv")

    assert "torque_acts_on" in open_keys(found.toml)
    assert found.channel("torque").unit == "N*m"


def test_without_a_time_column_the_rate_is_asked_for(tmp_path):
    found = inspected(tmp_path, walking().drop(columns="Time (s)"))

    (reason,) = found.obstacles
    assert "sample_rate_hz" in reason
    (line,) = [text for text in found.toml.splitlines() if text.startswith("sample_rate_hz")]
    assert "200.0 (strides then last 1 s)" in line
    assert "sample_rate_hz" in open_keys(found.toml)


@pytest.mark.parametrize(
    ("line", "rate_hz"),
    [
        ("Abtastrate: 500 Hz", 500.0),
        ("sample frequency = 500", None),
        ("# subject 3; fs: 1 kHz", 1000.0),
        ("Abtastfrequenz [Hz];500,0", 500.0),
        ("Messrate: 1.000 Hz", 1000.0),
        ("Messrate: 10,000 Hz", 10000.0),
        ("Messrate: 1.000 kHz", 1000.0),
        ("Sampling rate: 19.531 Hz", 19.531),
        ("Data rate: 115200", None),
        ("SR: 2", None),
        ("frecuencia de muestreo (Hz): 100", 100.0),
        ("Frequenza di campionamento = 2 kHz", 2000.0),
        ("Cut-off frequency: 20 Hz", None),
        ("heart rate: 70", None),
        ("Abtastrate: 500 Hz\nSampling rate: 1000 Hz", None),
        ("Abtastrate: 1000 Hz\nfs: 1 kHz", 1000.0),
    ],
)
def test_a_rate_that_a_header_line_states_is_written_as_stated(line, rate_hz, tmp_path):
    body = walking().drop(columns="Time (s)").to_csv(index=False, sep=";", decimal=",")
    (tmp_path / "S12.csv").write_text(f"{line}\n{body}")

    found = inspect_file(tmp_path / "S12.csv")

    (line,) = [line for line in found.toml.splitlines() if line.startswith("sample_rate_hz")]
    assert line == f"sample_rate_hz = {rate_hz}" or rate_hz is None
    assert ("sample_rate_hz" in open_keys(found.toml)) == (rate_hz is None)
    assert found.clocks[0].rate_hz == rate_hz


@pytest.mark.parametrize("other", ["Analog sampling rate: 2000 Hz", "Analog [Hz];2000"])
def test_a_rate_beside_that_of_another_instrument_is_asked_for(other, tmp_path):
    body = walking().drop(columns="Time (s)").to_csv(index=False, sep=";", decimal=",")
    (tmp_path / "S12.csv").write_text(f"Frame rate: 100 Hz\n{other}\n{body}")

    found = inspect_file(tmp_path / "S12.csv")

    assert "sample_rate_hz" in open_keys(found.toml)
    assert any("100, 2000 Hz" in note for note in found.notes)


def test_strides_at_which_nobody_walks_are_told_with_the_likely_rate(tmp_path):
    body = walking().drop(columns="Time (s)").to_csv(index=False)
    (tmp_path / "S12.csv").write_text(f"Sampling rate: 1000 Hz\n{body}")

    notes = inspect_file(tmp_path / "S12.csv").notes

    assert any("strides last 0.2 s" in n and "200 Hz" in n for n in notes)
    assert not any("strides last" in n for n in inspected(tmp_path, walking()).notes)


def test_stamps_stand_over_a_header_line_that_states_another_rate(tmp_path):
    (tmp_path / "S12.csv").write_text(f"fs: 1 kHz\n{walking().to_csv(index=False)}")

    found = inspect_file(tmp_path / "S12.csv")

    assert found.clocks[0].rate_hz == RATE_HZ
    assert any("1000 Hz" in note for note in found.notes)


def test_a_cell_that_is_no_number_is_named_and_stands_in_the_way(tmp_path):
    frame = walking().astype({"Torque (Nm)": object})
    frame.loc[700, "Torque (Nm)"] = "#DIV/0!"

    found = inspected(tmp_path, frame)

    assert found.channel("torque").n_missing == 1
    (reason,) = found.obstacles
    assert "row 702, column 'Torque (Nm)'" in reason


def test_signals_of_two_rates_are_not_mixed(tmp_path):
    names = (("knee angle", "rad"), ("knee torque", "N*m"))
    signals = (Signal(n, np.sin(np.arange(1000) / 50 + k), u) for k, (n, u) in enumerate(names))
    fast = SignalGroup("analogs", tuple(signals), rate_hz=1000.0)
    slow = SignalGroup("points", (Signal("LASI.x", np.arange(100.0), "mm"),), rate_hz=100.0)
    content = Acquisition((slow, fast), (Event(0.5, "heel strike"),))
    write_acquisition(content, tmp_path / "a.nc", lossy=True)

    found = inspect_file(tmp_path / "a.nc")

    assert {c.group: c.rate_hz for c in found.clocks} == {"points": 100.0, "analogs": 1000.0}
    assert found.channel("torque").group == "analogs"
    assert any("'points'" in note for note in found.notes)
    assert "sample_rate_hz = 1000.0\n" in found.toml


def test_one_side_is_begun_with_where_both_are_there(tmp_path):
    s = np.arange(400) / RATE_HZ
    frame = pd.DataFrame({"time": s})
    for side in ("Left", "Right"):
        for joint in ("Hip", "Knee"):
            frame[f"{side}{joint}FlexionAngle"] = np.sin(s)
            frame[f"{side}{joint}ExtensionMoment"] = np.cos(s)

    found = inspected(tmp_path, frame, "walk.csv")

    assert found.channel("angle").column == "RightKneeFlexionAngle"
    assert '[channels.torque]\ncolumn = "RightKneeExtensionMoment"' in found.toml
    assert 'positive = "extension"  # guess: its name says it' in found.toml
    assert 'side = "right"' in found.toml


def test_times_of_the_day_are_a_clock(tmp_path):
    frame = walking()
    time_s = frame["Time (s)"].to_numpy()
    frame["Time (s)"] = [
        f"23:59:{58 + s:06.3f}" if s < 2 else f"00:00:{s - 2:06.3f}" for s in time_s
    ]

    found = inspected(tmp_path, frame.rename(columns={"Time (s)": "Time"}))

    assert not found.obstacles
    assert 'unit = "hh:mm:ss"' in found.toml
    _, (recording,) = opened(tmp_path, found)
    np.testing.assert_allclose(np.diff(recording["time"]), np.diff(time_s), atol=1e-6)


def test_days_without_fractions_of_a_second_stand_in_the_way(tmp_path):
    frame = walking()
    frame["Time (s)"] = [f"27.11.2026 12:00:{int(s):02d}" for s in frame["Time (s)"]]

    (reason,) = inspected(tmp_path, frame.rename(columns={"Time (s)": "Time"})).obstacles

    assert "time stamp(s) are missing, repeat or go back" in reason


def test_units_of_a_known_log_are_guesses_and_that_is_a_sentence(tmp_path):
    s = np.arange(500) / RATE_HZ
    log = {"output_position": np.sin(s), "output_torque": np.cos(s), "motor_current": 1e3 * s}
    frame = pd.DataFrame({"time": s, **{f"knee.{name}": values for name, values in log.items()}})

    found = inspected(tmp_path, frame)

    torque = found.channel("torque")
    assert (torque.unit, torque.unit_is) == ("N*m", "guessed")
    assert any("opensourceleg" in note for note in found.notes)


def with_units(folder: Path, units: dict[str, str]):
    """Inspect a file with a row of units under its names."""
    frame = walking().rename(columns=lambda name: name.partition(" (")[0])
    text = frame.to_csv(index=False).splitlines()
    row = ",".join(f"[{units.get(name, '-')}]" for name in frame.columns)
    (folder / "S01.csv").write_text("\n".join([text[0], row, *text[1:]]) + "\n")
    return inspect_file(folder / "S01.csv")


KNOWN = {"Time": "s", "Torque": "Nm", "Knee angle": "deg", "commanded torque": "Nm"}


def test_a_row_of_units_is_held_against_what_the_names_say(tmp_path):
    assert with_units(tmp_path, KNOWN).obstacles == ()

    (volts,) = with_units(tmp_path, KNOWN | {"Knee angle": "V"}).obstacles
    (percent,) = with_units(tmp_path, KNOWN | {"Time": "%"}).obstacles

    assert "'Knee angle'" in volts
    assert "'Time'" in percent
    assert with_units(tmp_path, KNOWN | {"Torque": "x/gr"}).channel("torque").unit_is == "guessed"


@pytest.mark.parametrize("name", ["Torque\n(Nm)", "torque\x7f", 'torque"', "torque\\"])
def test_names_with_odd_letters_give_a_study_that_can_be_read(name, tmp_path):
    frame = walking().rename(columns={"Torque (Nm)": name})
    signals = tuple(Signal(n, frame[n].to_numpy(float)) for n in list(frame.columns)[1:])
    content = SignalGroup("", signals, time_s=frame["Time (s)"].to_numpy())
    write_file(tmp_path / "S01.parquet", content)

    found = inspect_file(tmp_path / "S01.parquet")

    assert found.channel("torque").unit == "N*m"
    assert len(opened(tmp_path, found)[1]) == 1


@pytest.mark.parametrize("rate_hz", [100.0, 2500.0, 8000.0])
def test_milliseconds_are_told_from_seconds_at_any_rate(rate_hz, tmp_path):
    s = np.arange(2000) / rate_hz
    for name, times in (("s", s), ("ms", 1e3 * s)):
        frame = walking().rename(columns={"Time (s)": "time"}).assign(time=times)
        assert inspected(tmp_path, frame).channel("time").unit == name


def test_the_file_is_named_from_where_the_study_will_stand(tmp_path):
    (tmp_path / "data").mkdir()
    walking().to_csv(tmp_path / "data" / "S01.csv", index=False)

    found = inspect_file(tmp_path / "data" / "S01.csv", study_folder=tmp_path)

    assert 'file = "data/S01.csv"' in found.toml
    assert len(opened(tmp_path, found)[1]) == 1


def test_units_speak_where_names_do_not(tmp_path):
    frame = walking()
    frame["Torque (Nm)"] += frame["commanded torque (Nm)"]
    frame["footswitch"] = 0.3 + 4.5 * frame["footswitch"] + 0.01 * np.sin(np.arange(2000))
    frame.columns = ["t_s", "Knee_deg", "M_sensor_Nm", "M_cmd_Nm", "Heel_V"]

    found = inspected(tmp_path, frame)

    study, _ = opened(tmp_path, found)
    assert "torque_acts_on" in open_keys(found.toml)
    assert study.spec.channels["contact"].kind == "voltage"
    assert found.channel("angle").guess == "its unit and name"


def test_a_command_is_not_turned_for_a_torque_that_counts_the_other_way(tmp_path):
    frame = walking()
    frame["Torque (Nm)"] = -frame["Torque (Nm)"] - frame["commanded torque (Nm)"]
    frame = frame.rename(columns={"Torque (Nm)": "extension torque (Nm)"})

    study, (recording,) = opened(tmp_path, inspected(tmp_path, frame))

    assert study.spec.torque_acts_on == "joint"
    assert float(recording["command"].max()) == 17.0
    assert float((recording["command"] * recording["torque"]).mean()) > 0.0


def test_what_only_the_reader_knows_stands_there_to_be_answered(tmp_path):
    found = inspected(tmp_path, walking())
    (tmp_path / "study.toml").write_text(found.toml)

    asked = [line for line in found.toml.splitlines() if line.startswith("# ")]
    keys = ["torque_acts_on", "positive", "unit", "positive", "positive"]
    assert open_keys(found.toml) == keys
    with pytest.raises(StudyError, match=r"torque_acts_on: open[^$]*channels.angle.positive: open"):
        open_study(tmp_path)
    for begin in ("side =", "mass_kg =", "[[participants]]", "[[recordings]]", "[perturbations]"):
        assert [line for line in asked if line.startswith(f"# {begin}")]
    answers = {
        "# side =": "side =",
        "# [perturbations]": "[perturbations]",
        "# timing_points = { name = % }": "timing_points = { swing = 70.0 }",
    }
    text = found.toml
    for question, answer in answers.items():
        assert text.count(question) == 1
        text = text.replace(question, answer)
    (tmp_path / "study.toml").write_text(answered(text, positive="extension"))
    spec = open_study(tmp_path).spec
    assert spec.channels["angle"].positive == "extension"
    assert spec.recordings[0].side == "right"
    assert spec.perturbations.timing_points == {"swing": 70.0}


def test_what_the_file_decides_is_not_asked(tmp_path):
    frame = walking().rename(columns={"Knee angle": "Knee flexion angle"})
    named = inspected(tmp_path, frame, "S07_right.csv")
    still = inspected(tmp_path, walking().assign(**{"commanded torque (Nm)": 0.0}), "S08.csv")
    # A bench whose torque was set against the angle: to turn the angle alone would undo that.
    bench = inspected(tmp_path, walking()[["Time (s)", "Knee angle", "Torque (Nm)"]], "bench.csv")

    assert "# positive" not in named.toml
    assert "# side" not in named.toml
    assert "timing_points" not in still.toml
    assert "# positive" not in bench.toml
