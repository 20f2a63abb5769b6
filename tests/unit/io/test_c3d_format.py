"""C3D: what comes back, what does not fit, the traps of the format, and damaged files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.formats.registry import format_of, read_acquisition, write_acquisition
from jointz.io.text.column_names import distinct_names, unique_names

C3D = Path("any.c3d")
IN_TMP_PATH = settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
LETTERS = st.characters(codec="utf-8", exclude_characters="\0")
WORDS = st.text(LETTERS, min_size=1, max_size=8).filter(lambda text: text == text.rstrip(" "))
SINGLE = st.floats(width=32, allow_nan=True, allow_infinity=True)
NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,9}", fullmatch=True)
RATES = st.sampled_from([1.0, 33.3, 50.0, 59.94, 100.0, 148.148, 1000.0])
NUMBER_LIKE = st.sampled_from(["7", "-3", "40000", "0.5", "[1, 2]", "[[0.5, 1.0]]", '["a", "b"]'])


def single(value: float) -> float:
    return float(str(np.float32(value)))


def columns(draw: st.DrawFn, n: int, count: int) -> list[np.ndarray]:
    cells = st.lists(SINGLE, min_size=n * count, max_size=n * count)
    return list(np.array(draw(cells), dtype=np.float64).reshape(count, n))


@st.composite
def contents(draw: st.DrawFn) -> Acquisition:
    """All that a C3D file can hold."""
    n, ratio, rate = draw(st.integers(0, 4)), draw(st.integers(1, 3)), draw(RATES)
    start = draw(st.integers(0, 200_000)) / rate
    roles = draw(st.sets(st.sampled_from(["points", "analogs", "rotations"]), min_size=1))
    ratio = ratio if "points" in roles else 1
    groups = []
    if "points" in roles:
        labels = draw(st.lists(WORDS, min_size=1, max_size=4, unique=True))
        units = draw(st.lists(st.sampled_from(["mm", "deg", "N", "Nmm", "W"]), min_size=4))
        signals = []
        for label, unit in zip(labels, units, strict=False):
            note = draw(st.just("") | WORDS)
            cells = zip("xyz", columns(draw, n, 3), strict=True)
            signals += [Signal(f"{label}.{axis}", v, unit, note) for axis, v in cells]
        groups.append(SignalGroup("points", tuple(signals), rate, start))
    if "analogs" in roles:
        labels = draw(st.lists(WORDS, min_size=1, max_size=4, unique=True))
        unit, note = draw(st.just("") | WORDS), draw(st.just("") | WORDS)
        values = columns(draw, n * ratio, len(labels))
        found = [Signal(a, v, unit, note) for a, v in zip(labels, values, strict=True)]
        groups.append(SignalGroup("analogs", tuple(found), single(rate * ratio), start))
    if "rotations" in roles:
        cells = columns(draw, n, 16)
        whole = ~np.isnan(cells).any(axis=0)
        names = [f"thigh.r{i}{j}" for j in range(1, 5) for i in range(1, 5)]
        matrix = [Signal(a, np.where(whole, v, np.nan)) for a, v in zip(names, cells, strict=True)]
        groups.append(SignalGroup("rotations", tuple(matrix), rate, start))
    times = st.tuples(st.integers(0, 90), st.floats(0, 59, width=32))
    moments = sorted(60.0 * minutes + s for minutes, s in draw(st.lists(times, max_size=4)))
    labels = [draw(WORDS | st.sampled_from(["Left Foot Strike", "General x"])) for _ in moments]
    events = tuple(Event(t, label) for t, label in zip(moments, labels, strict=True))
    keys = st.tuples(NAMES, NAMES).map(lambda pair: f"my_{pair[0]}.{pair[1]}")
    metadata = draw(st.dictionaries(keys, WORDS | NUMBER_LIKE, max_size=4))
    return Acquisition(tuple(groups), events, metadata)


@IN_TMP_PATH
@given(content=contents())
def test_what_a_c3d_file_can_hold_comes_back(content: Acquisition, tmp_path: Path) -> None:
    path = tmp_path / "held.c3d"
    assert write_acquisition(content, path) == []
    assert read_acquisition(path).equals(content)


def points(rate: float = 100.0, start: float = 0.0, n: int = 4) -> SignalGroup:
    values = np.arange(3 * n, dtype=np.float64).reshape(3, n) / 4
    values[:, 1] = np.nan
    cells = zip("xyz", values, strict=True)
    return SignalGroup("points", tuple(Signal(f"LKNE.{a}", v, "mm") for a, v in cells), rate, start)


def analogs(rate: float = 200.0, start: float = 0.0, n: int = 8) -> SignalGroup:
    signals = (Signal("torque", np.arange(n) / 8, "Nm", "at the knee"), Signal("emg", np.ones(n)))
    return SignalGroup("analogs", signals, rate, start)


def content(*groups: SignalGroup, **more: object) -> Acquisition:
    return Acquisition(groups, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("start", [65533.0, 65534.0, 65535.0, 65536.0])
@pytest.mark.parametrize("n", [0, 1, 3])
def test_frames_are_counted_beyond_what_the_header_can(
    tmp_path: Path, start: float, n: int
) -> None:
    late = content(cut(points(1.0, start), n))
    assert write_acquisition(late, tmp_path / "late.c3d") == []
    assert read_acquisition(tmp_path / "late.c3d").equals(late)


def cut(group: SignalGroup, n: int) -> SignalGroup:
    signals = tuple(replace(s, values=s.values[:n]) for s in group.signals)
    return replace(group, signals=signals)


ODD = np.array([0.1, 1.0, 2.0, 3.0])
UNEVEN = np.array([0.0, 0.01, 0.02, 9.03])


def alone(values: np.ndarray, name: str = "x", unit: str = "") -> Acquisition:
    return content(SignalGroup("analogs", (Signal(name, values, unit),), 10.0))


def stamped(time_s: np.ndarray | None) -> Acquisition:
    return content(replace(points(), rate_hz=None, time_s=time_s))


METRES = (replace(points().signals[0], unit="m"), *points().signals[1:])


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        (content(SignalGroup("imu", analogs().signals, 200.0)), "'imu' is called 'analogs'"),
        (content(points(), analogs(), SignalGroup("c", points().signals, 9.0)), "no place of its"),
        (content(analogs(), points()), "come in the order points, analogs, rotations"),
        (alone(np.array(["a"], dtype=object)), "has no signals of numbers"),
        (alone(ODD), "single precision, by up to 1.49e-09: x."),
        (alone(np.array([1e300])), "1 values are too large"),
        (content(points(), analogs(rate=250.0, n=10)), "250 Hz is no whole multiple of the 100 Hz"),
        (content(points(), analogs(start=0.5)), "it starts at 0.5 s, the frames at 0 s"),
        (content(points(), analogs(start=0.001)), "starts with the frames, -0.001 s later"),
        (content(points(), analogs(n=9)), "cut to whole frames, by 1 samples"),
        (content(points(start=0.003)), "first sample is at 0 s there, not at 0.003 s"),
        (content(points(start=-1.0)), "first sample is at 0 s there, not at -1.0 s"),
        (content(points(rate=100 / 3)), "33.333333333333336 Hz, is rounded to 33.333332 Hz"),
        (content(replace(points(), rate_hz=1e300)), "has no rate of 1e+300 Hz"),
        (stamped(None), "it has no clock"),
        (stamped(np.arange(4) / 100), "a clock of 100 Hz, which differs from them by up to 0 s"),
        (stamped(UNEVEN), "time stamps are not uniform"),
        (content(points(), events=(Event(0.1, "go"),)), "rounded, by up to 1.49e-09 s"),
        (content(points(), events=(Event(1.0, "go", 0.5),)), "durations of events: go"),
        (content(points(), events=(Event(2.0, "b"), Event(1.0, "a"))), "in the order of time"),
        (content(points(), events=(Event(np.inf, "b"),)), "at no finite time are left out"),
        (content(points(), events=(Event(1.0, "b "),)), "Labels of events change: 'b '"),
        (content(points(), events=(Event(1.0, "x" * 300),)), "Labels of events change: 'xxx"),
        (content(points(), events=(Event(1.0, "\ud800"),)), "Labels of events change: '\\ud800'"),
        (content(points(), metadata={"Subject.Name": "x"}), "metadata: Subject.Name"),
        (content(points(), metadata={"name": "x"}), "metadata: name"),
        (content(points(), metadata={"point.used": "9"}), "metadata: point.used"),
        (content(points(), metadata={"a.b": "x" * 256}), "metadata: a.b"),
        (alone(np.ones(2), "x "), "Names change: 'x '"),
        (alone(np.ones(2), unit="u" * 300), "no place for the units of x"),
        (content(replace(points(), signals=METRES)), "no place for the units of LKNE.y, LKNE.z"),
    ],
)
def test_what_a_c3d_file_cannot_hold_is_named(
    given_: Acquisition, words: str, tmp_path: Path
) -> None:
    lost = format_of(C3D).losses(given_)
    assert any(words in sentence for sentence in lost), lost
    path = tmp_path / "lossy.c3d"
    with pytest.raises(DataError, match="cannot hold all of it"):
        write_acquisition(given_, path)
    if any("No group of it" in sentence for sentence in lost):
        with pytest.raises(DataError, match="C3D can hold nothing of it"):
            write_acquisition(given_, path, lossy=True)
        return
    assert write_acquisition(given_, path, lossy=True) == lost
    assert not read_acquisition(path).equals(given_)


def of_units(**units: str) -> Acquisition:
    """Points, each with a unit."""
    signals = [Signal(f"{k}.{axis}", np.zeros(2), u) for k, u in units.items() for axis in "xyz"]
    return content(SignalGroup("points", tuple(signals), 10.0))


def units_read(path: Path) -> list[tuple[str, str]]:
    return [(s.name, s.unit) for s in read_acquisition(path).groups[0].signals[::3]]


def test_points_of_two_units_of_one_kind_are_not_given_a_wrong_one(tmp_path: Path) -> None:
    path = tmp_path / "a.c3d"
    (sentence,) = write_acquisition(of_units(A="mm", B="deg", C="rad"), path, lossy=True)
    assert sentence == "Points of one kind have one unit; left out: C (rad)."
    assert units_read(path) == [("A.x", "mm"), ("B.x", "deg")]


def test_a_label_that_stands_twice_has_the_unit_of_its_kind_twice(tmp_path: Path) -> None:
    path = tmp_path / "a.c3d"
    write_acquisition(of_units(LKNE="mm", KneeAngles="deg", KneeAnglez="deg"), path)
    path.write_bytes(path.read_bytes().replace(b"KneeAnglez", b"KneeAngles"))
    names = ("LKNE.x", "KneeAngles.x", "KneeAngles#2.x")
    assert units_read(path) == list(zip(names, ("mm", "deg", "deg"), strict=True))


def rotations(rate: float, start: float = 0.0) -> SignalGroup:
    names = [f"t.r{i}{j}" for j in range(1, 5) for i in range(1, 5)]
    return SignalGroup("rotations", tuple(Signal(n, np.zeros(1)) for n in names), rate, start)


def test_more_signals_than_a_frame_holds_are_left_out_and_the_others_written(
    tmp_path: Path,
) -> None:
    signals = tuple(Signal(f"c{i}", np.zeros(1)) for i in range(65_536))
    both = content(SignalGroup("analogs", signals, 100.0), rotations(100.0))
    assert "65536 signals are more than a frame" in " ".join(format_of(C3D).losses(both))
    write_acquisition(both, tmp_path / "a.c3d", lossy=True)
    assert [g.name for g in read_acquisition(tmp_path / "a.c3d").groups] == ["rotations"]


def test_more_groups_of_metadata_than_there_are_numbers_are_named(tmp_path: Path) -> None:
    late = [cut(group(1.0, 70_000.0), 1) for group in (points, analogs)]
    metadata = {f"g{i}.a": "x" for i in range(123)}
    events = (Event(1.0, "go"),)
    full = content(*late, rotations(1.0, 70_000.0), events=events, metadata=metadata)
    path = tmp_path / "a.c3d"
    assert write_acquisition(full, path, lossy=True) == ["It has no place for metadata: g122.a."]
    back = read_acquisition(path)
    assert [g.name for g in back.groups] == ["points", "analogs", "rotations"]
    assert len(back.metadata) == 122


def test_many_channels_of_one_name_take_no_long_time() -> None:
    names = distinct_names(["Fx"] * 60_000, 60_000, "analog")
    assert (names[1], names[-1]) == ("Fx#2", "Fx#60000")
    assert unique_names(["a"] * 60_000)[-1] == "a_60000"


def test_too_much_text_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    metadata = {f"a.b{i}": "x" * 250 for i in range(600)}
    with pytest.raises(DataError, match="a C3D file has room for 130560"):
        write_acquisition(content(points(), metadata=metadata), tmp_path / "a.c3d")
    assert not list(tmp_path.iterdir())


def test_more_frames_than_a_word_can_count(tmp_path: Path) -> None:
    n = 70_000
    group = SignalGroup("analogs", (Signal("x", np.arange(n, dtype=float)),), 1000.0, 2.0)
    path = tmp_path / "long.c3d"
    assert write_acquisition(content(group), path) == []
    assert read_acquisition(path).equals(content(group))
    ezc3d = pytest.importorskip("ezc3d", reason="the other reader is not installed")
    assert ezc3d.c3d(str(path))["data"]["analogs"].shape == (1, 1, n)


def test_ezc3d_reads_what_we_write(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="the other reader is not installed")
    given_ = content(
        points(start=0.5),
        analogs(start=0.5),
        events=(Event(61.5, "Left Foot Strike"),),
        metadata={"subjects.names": "S01", "my.matrix": "[[1.5, 2.0], [3.0, 4.0]]"},
    )
    path = tmp_path / "ours.c3d"
    assert write_acquisition(given_, path) == []
    other = ezc3d.c3d(str(path))
    seen = np.stack([s.values for s in given_.groups[0].signals])
    assert np.array_equal(other["data"]["points"][:3, 0], seen, equal_nan=True)
    sent = np.stack([s.values for s in given_.groups[1].signals])
    assert np.array_equal(other["data"]["analogs"][0], sent)
    assert other["header"]["points"]["first_frame"] == 50
    assert other["header"]["analogs"]["frame_rate"] == 200.0
    parameters = other["parameters"]
    assert parameters["EVENT"]["TIMES"]["value"].tolist() == [[1.0], [1.5]]
    assert parameters["EVENT"]["CONTEXTS"]["value"] == ["Left"]
    assert parameters["MY"]["MATRIX"]["value"].tolist() == [[1.5, 2.0], [3.0, 4.0]]
    assert parameters["ANALOG"]["UNITS"]["value"] == ["Nm", ""]


def test_we_read_what_ezc3d_writes(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="the other writer is not installed")
    rng = np.random.default_rng(1)
    other = ezc3d.c3d()
    other["parameters"]["POINT"]["RATE"]["value"] = [100]
    other["parameters"]["POINT"]["LABELS"]["value"] = ("A", "B")
    other["parameters"]["ANALOG"]["RATE"]["value"] = [300]
    other["parameters"]["ANALOG"]["LABELS"]["value"] = ("c",)
    seen = rng.normal(size=(3, 2, 5)).astype(np.float32).astype(float)
    sent = rng.normal(size=(1, 1, 15)).astype(np.float32).astype(float)
    turned = rng.normal(size=(4, 4, 1, 10)).astype(np.float32).astype(float)
    other["data"]["points"] = np.concatenate([seen, np.ones((1, 2, 5))])
    other["data"]["analogs"] = sent
    other.add_parameter("ROTATION", "LABELS", ["thigh"])
    other.add_parameter("ROTATION", "USED", [1])
    other.add_parameter("ROTATION", "DATA_START", [0])
    other["parameters"]["ROTATION"]["DATA_START"]["type"] = 2  # which its door makes a float
    other["parameters"]["ROTATION"]["DATA_START"]["value"] = np.array([0])
    other["data"]["rotations"] = turned
    path = tmp_path / "theirs.c3d"
    other.write(str(path))
    found = {group.name: group for group in read_acquisition(path).groups}
    cells = np.stack([s.values for s in found["points"].signals]).reshape(2, 3, 5)
    assert np.array_equal(cells, seen.transpose(1, 0, 2))
    assert np.array_equal(found["analogs"].signals[0].values, sent[0, 0])
    matrix = {s.name: s.values for s in found["rotations"].signals}
    assert np.array_equal(matrix["thigh.r12"], turned[0, 1, 0])
    assert found["rotations"].rate_hz == 200.0
