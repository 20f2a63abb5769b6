"""Files of jointz out of which another program took columns or rows."""

from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.io.formats.registry import read_acquisition, write_acquisition

N = 40


EARLIER = Path(__file__).parent / "earlier" / "earlier.parquet"


def written(path: Path) -> None:
    signals = tuple(
        Signal(name, np.arange(N) * float(k), "N") for k, name in enumerate("abc", start=1)
    )
    content = Acquisition(
        (SignalGroup("", signals, 100.0),), (Event(0.1, "HS"),), {"subject": "S01"}
    )
    write_acquisition(content, path)


CHANGES = {
    "columns taken out": lambda t: t.select([t.column_names[0], "c"]),
    "columns in another order": lambda t: t.select([t.column_names[0], "b", "a", "c"]),
    "the clock taken out": lambda t: t.select(["a", "b", "c"]),
    "the first rows taken out": lambda t: t.slice(10),
    "rows taken out between": lambda t: t.filter(pa.array(np.arange(N) % 4 == 0)),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_parquet_table_that_was_changed_is_read_as_any_other_and_says_so(tmp_path, change):
    path = tmp_path / "a.parquet"
    table = change(pq.read_table(EARLIER))
    pq.write_table(table, path)
    names = table.column_names[-2:]

    content = read_acquisition(path)

    (group,) = content.groups
    assert group.rate_hz is None
    assert content.events == ()
    assert "not the one that jointz wrote" in content.metadata["reading.jointz"]
    for signal in group.signals[-2:]:
        assert signal.name in table.column_names
        np.testing.assert_array_equal(signal.values, table.column(signal.name).to_numpy())
    assert {s.name for s in group.signals} >= set(names) - {"time [s]"}
    if group.time_s is not None:
        np.testing.assert_array_equal(group.time_s, table.column("time [s]").to_numpy())


def test_rows_of_a_stamped_table_keep_what_stands_beside_it(tmp_path):
    table = pq.read_table(EARLIER)
    metadata = dict(table.schema.metadata)
    metadata[b"jointz"] = metadata[b"jointz"].replace(
        b'"rate_hz": 100.0, "start_s": 0.0, "stamped": false',
        b'"rate_hz": null, "start_s": 0.0, "stamped": true',
    )
    pq.write_table(table.slice(10).replace_schema_metadata(metadata), tmp_path / "a.parquet")

    content = read_acquisition(tmp_path / "a.parquet")

    np.testing.assert_array_equal(content.groups[0].time_s, np.arange(10, N) / 100.0)
    assert (content.events, content.metadata) == ((Event(0.1, "HS"),), {"subject": "S01"})


def cut(path: Path, *, first: int, step: int, clock: bool = True) -> None:
    """Take samples out as ncks -d does: attributes stay, and the seal is gone."""
    with h5py.File(path, "r") as old:
        values = {name: old["g1"][name][first::step] for name in ("a", "b", "c", "clock")}
        attributes = {key: value for key, value in old["g1"].attrs.items() if key[0] != "_"}
    path.unlink()
    with h5netcdf.File(path, "w") as file:
        file.attrs["jointz_acquisition"] = "1"
        place = file.create_group("g1")
        place.dimensions["sample"] = len(values["a"])
        for key, value in attributes.items():
            place.attrs[key] = value
        for name, samples in values.items():
            if name != "clock" or clock:
                place.create_variable(name, ("sample",), np.float64, data=samples)
                place[name].attrs["name"] = name
        for name, columns in (("events", ("time_s", "duration_s")), ("metadata", ())):
            other = file.create_group(name)
            other.dimensions["sample"] = 0
            for column in columns:
                other.create_variable(column, ("sample",), np.float64)
            for column in ("label",) if columns else ("key", "value"):
                other.create_variable(column, ("sample",), h5py.string_dtype())


@pytest.mark.parametrize(("first", "step"), [(10, 1), (0, 4)])
def test_netcdf_samples_that_were_taken_out_keep_their_own_stamps(tmp_path, first, step):
    path = tmp_path / "a.nc"
    written(path)
    cut(path, first=first, step=step)

    content = read_acquisition(path)

    (group,) = content.groups
    assert group.rate_hz is None
    np.testing.assert_array_equal(group.time_s, (np.arange(N) / 100.0)[first::step])
    assert "whose stamps are taken" in content.metadata["reading.clock."]


def test_a_netcdf_rate_without_the_clock_it_came_with_is_not_trusted(tmp_path):
    path = tmp_path / "a.nc"
    written(path)
    cut(path, first=0, step=2, clock=False)

    content = read_acquisition(path)

    assert content.groups[0].times_s() is None
    assert "which have no clock" in content.metadata["reading.clock."]
