"""The printed numbers of chapter IV against each other, row by row and against the data."""

import itertools
import re
from collections.abc import Mapping

import pandas as pd
import pytest

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import Printed, chapter2, chapter3, chapter4, row_mean

#: Half a unit of the last printed digit of the means.
HALF_DIGIT = dict.fromkeys(("damping_per_mass", "inertia"), 0.0005)
HALF_DIGIT |= dict.fromkeys(("stiffness_per_mass", "vaf"), 0.005)
#: Columns of the published data: values and corrections.
COLUMNS = {
    "stiffness_per_mass": ("stiffness_Nm_per_rad_per_kg", "stiffness_correction"),
    "damping_per_mass": ("damping_Nms_per_rad_per_kg", "damping_correction"),
    "inertia": ("inertia_kgm2", "inertia_correction"),
    "vaf": ("vaf_percent", "vaf_correction"),
}


def every_printed(value):
    """Walk through mappings and tuples down to the numbers."""
    if isinstance(value, Printed):
        yield value
    elif isinstance(value, Mapping | tuple):
        parts = value.values() if isinstance(value, Mapping) else value
        yield from itertools.chain.from_iterable(map(every_printed, parts))


@pytest.mark.parametrize(("chapter", "least"), [(chapter2, 4), (chapter3, 15), (chapter4, 240)])
def test_every_number_names_its_source(chapter, least):
    numbers = [n for value in vars(chapter).values() for n in every_printed(value)]
    assert len(numbers) > least
    assert all(n.source for n in numbers)


def cells(name):
    return {
        (subject, point): cell
        for point, row in chapter4.TABLES[name].items()
        for subject, cell in row.items()
    }


@pytest.fixture
def published(real_data):
    table = pd.read_csv(real_data / "dissertation" / "knee_impedance_60.csv")
    return table.set_index(["subject", "timing_point"])


# --- tables 4.1 to 4.4 ---------------------------------------------------------------------------


@pytest.mark.parametrize("point", TIMING_POINTS)
@pytest.mark.parametrize("name", chapter4.TABLES)
def test_every_printed_mean_is_the_mean_of_its_row(name, point):
    mean, printed = row_mean(chapter4.TABLES[name][point]), chapter4.MEANS[name][point].value
    assert abs(mean - printed) <= HALF_DIGIT[name] + 1e-12  # 0.0295 is printed as 0.030


@pytest.mark.parametrize(
    ("name", "point", "subject", "damaged"),
    [
        ("stiffness_per_mass", "ISW", "S6", 20.048),
        ("stiffness_per_mass", "MSW", "S5", 20.62),
        ("damping_per_mass", "PSW", "S9", 80.018),
        ("inertia", "LRE", "S4", 50.011),
        ("inertia", "MST", "S2", 30.010),
        ("inertia", "MST", "S10", 50.002),
        ("inertia", "TST", "S4", 0.14),
        ("inertia", "TST", "S8", 50.017),
        ("inertia", "TST", "S10", 10.008),
    ],
)
def test_every_repaired_digit_is_noted_and_the_damaged_one_breaks_its_row(
    name, point, subject, damaged
):
    row, printed = chapter4.TABLES[name][point], chapter4.MEANS[name][point].value
    assert row[subject].note.startswith("repaired")
    assert float(re.findall(r"\d+\.\d+", row[subject].note)[0]) == damaged

    mean = row_mean(row) + (damaged - row[subject].value) / len(row)
    assert abs(mean - printed) > 10 * HALF_DIGIT[name]


@pytest.mark.real_data
@pytest.mark.parametrize("name", chapter4.TABLES)
def test_tables_are_those_of_the_data_with_the_same_corrections(name, published):
    long = chapter4.participant_table()
    assert len(long) == 60
    assert list(long["timing_point"].cat.categories) == list(TIMING_POINTS)
    long = long.set_index(["participant", "timing_point"])
    value, correction = COLUMNS[name]
    for key, cell in cells(name).items():
        assert cell.value == published.loc[key, value]
        assert cell.note.startswith("repaired") == isinstance(published.loc[key, correction], str)
        assert long.loc[key, "vaf_pct" if name == "vaf" else name] == cell.value
