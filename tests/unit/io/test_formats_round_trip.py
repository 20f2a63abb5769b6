"""What a format says that it can hold, it gives back; what it cannot, it names."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from tests.unit.io.same_content import is_same_content

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.formats.registry import (
    format_to_write,
    read_acquisition,
    write_acquisition,
)
from jointz.io.text.column_names import is_time, name_with_unit

TABLES = ["a.csv", "a.csv.gz", "a.tsv", "a.txt"]
EVERY = ["a.nc", *TABLES]
in_tmp_path = settings(
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.filter_too_much],
    max_examples=8,
)

LETTERS = st.characters(codec="utf-8", exclude_categories=["Cs"])
WORDS = st.text(LETTERS, max_size=12)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True, width=64)
FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)


def objects(texts: list[str]) -> np.ndarray:
    array = np.empty(len(texts), dtype=object)
    array[:] = texts
    return array


@st.composite
def groups(draw: st.DrawFn, name: str, *, n_least: int = 0) -> SignalGroup:
    """Up to three signals of numbers or text on a clock of any kind."""
    n = draw(st.integers(n_least, 6))
    names = draw(st.lists(WORDS.filter(lambda w: not is_time(w)), max_size=3, unique=True))
    signals = []
    for own in names:
        numbers = st.lists(NUMBERS, min_size=n, max_size=n).map(np.array)
        texts = st.lists(WORDS, min_size=n, max_size=n).map(objects)
        values = draw(numbers | texts)
        values = values if values.dtype.kind == "O" else values.astype(np.float64)
        unit = draw(st.sampled_from(["", "deg", "N*m", "µV", "deg/s"]))
        signals.append(Signal(own, values, unit, draw(WORDS)))
    clock = draw(st.sampled_from(["rate", "stamps"] if not signals else ["rate", "stamps", "none"]))
    if clock == "rate" and signals:
        rate = draw(st.floats(0.1, 1e5))
        return SignalGroup(name, tuple(signals), rate, draw(st.floats(-1e3, 1e3)))
    if clock == "none":
        return SignalGroup(name, tuple(signals))
    steps = draw(st.lists(st.floats(1e-4, 1e3), min_size=n, max_size=n))
    return SignalGroup(name, tuple(signals), time_s=np.cumsum(np.array(steps, dtype=np.float64)))


@st.composite
def acquisitions(draw: st.DrawFn, *, n_groups: tuple[int, int] = (0, 3)) -> Acquisition:
    names = draw(st.lists(WORDS, min_size=n_groups[0], max_size=n_groups[1], unique=True))
    events = st.builds(Event, FINITE, WORDS, FINITE)
    metadata = st.dictionaries(WORDS, WORDS, max_size=3)
    return Acquisition(
        tuple(draw(groups(name)) for name in names),
        tuple(draw(st.lists(events, max_size=3))),
        draw(metadata),
    )


@given(content=acquisitions())
@in_tmp_path
def test_a_whole_acquisition_comes_back_from_netcdf(tmp_path: Path, content: Acquisition) -> None:
    path = tmp_path / "a.nc"
    assume(not format_to_write(path).losses(content))

    assert write_acquisition(content, path) == []
    back = read_acquisition(path)

    assert is_same_content(back, content), (back, content)


@pytest.mark.parametrize("name", TABLES)
@given(group=groups("", n_least=1))
@in_tmp_path
def test_columns_of_text_tables_come_back_under_the_names_they_stand_under(
    tmp_path: Path, name: str, group: SignalGroup
) -> None:
    path = tmp_path / name
    # A text table keeps the unit in the name, and time stamps instead of a rate.
    signals = tuple(replace(s, name=name_with_unit(s), description="") for s in group.signals)
    content = Acquisition((SignalGroup("", signals, time_s=group.times_s()),))
    assume(not format_to_write(path).losses(content))
    assume(len({s.name for s in signals}) == len(signals))

    write_acquisition(content, path)

    back = read_acquisition(path)
    own = {key: text for key, text in back.metadata.items() if not key.startswith("reading.")}
    assert is_same_content(replace(back, metadata=own), content)


@pytest.mark.parametrize("name", EVERY)
@given(content=acquisitions(n_groups=(1, 2)))
@in_tmp_path
def test_any_acquisition_is_written_with_losses_named_or_refused(
    tmp_path: Path, name: str, content: Acquisition
) -> None:
    path = tmp_path / name
    path.unlink(missing_ok=True)
    try:
        lost = write_acquisition(content, path, lossy=True)
    except DataError:
        assert not path.exists()
        return
    assert all(sentence.endswith(".") for sentence in lost)
    back = read_acquisition(path)
    assert len(back.groups) >= 1
    if not lost:
        assert [s.n_samples for s in back.groups] == [s.n_samples for s in content.groups]


def ramp(name: str = "knee", unit: str = "", n: int = 4) -> Signal:
    return Signal(name, np.arange(n) / 3.0, unit)


def holding(*groups_: SignalGroup, **more: object) -> Acquisition:
    return Acquisition(groups_, **more)  # type: ignore[arg-type]


SHORT = ramp("short", n=2)
LOSSES: list[tuple[str, Acquisition, str]] = [
    ("csv", holding(SignalGroup("a", (ramp(),)), SignalGroup("b", (ramp(),))), "left out: 'b'"),
    ("csv", holding(SignalGroup("", (ramp(),)), events=(Event(0.0, "HS"),)), "events (1"),
    ("csv", holding(SignalGroup("", (ramp(),)), metadata={"subject": "S01"}), "subject"),
    ("csv", holding(SignalGroup("", (replace(ramp(), description="left"),))), "descriptions"),
    ("csv", holding(SignalGroup("", (Signal("id", objects(["1", "2"])), SHORT))), "looks like one"),
    ("csv", holding(SignalGroup("", (Signal("id", objects(["1", "a"])), SHORT))), "looks like one"),
    ("csv", holding(SignalGroup("", (Signal("id", objects(["a\nb", "c"])), SHORT))), "line ends"),
    ("csv", holding(SignalGroup("", (Signal("id", objects(["a", "c"])),))), "text alone"),
    ("csv", holding(SignalGroup("", (ramp("a\nb"),))), "the name"),
    ("nc", holding(SignalGroup("", (Signal("a", objects(["\ud800"])),))), "half letters"),
]


@pytest.mark.parametrize(("kind", "content", "words"), LOSSES)
def test_what_is_lost_is_named_and_refused_without_leave(
    tmp_path: Path, kind: str, content: Acquisition, words: str
) -> None:
    path = tmp_path / f"a.{kind}"

    (sentence,) = format_to_write(path).losses(content)

    assert words in sentence
    with pytest.raises(DataError, match="lossy"):
        write_acquisition(content, path)
    assert not path.exists()


@pytest.mark.parametrize("name", EVERY)
def test_a_file_that_cannot_be_written_leaves_nothing(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from jointz.core.errors import WriteError

    def full(self: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    content = holding(SignalGroup("", (ramp(),), 10.0))

    with pytest.raises(WriteError, match="No space left"):
        write_acquisition(content, tmp_path / name, lossy=True)

    assert list(tmp_path.iterdir()) == []
