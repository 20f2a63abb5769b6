"""The table of resemblance: figures of simulated people beside printed ones."""

import pandas as pd
import pytest
from benchmarks.resemblance import figures_of, printed_figures, table_of


def cells() -> pd.DataFrame:
    line = {"stiffness_per_mass": 1.0, "damping_per_mass": 0.03, "inertia": 0.2}
    more = {"vaf_pct": 90.0, "response_deg": 6.0}
    low = {"stiffness_per_mass": 0.0, "vaf_pct": 80.0, "inertia": 0.4}
    points = ({"timing_point": "LRE"}, {"timing_point": "MST"}, {"timing_point": "LRE"})
    first, second, third = (point | line | more for point in points)
    return pd.DataFrame([first, second, third | low])


def test_figures_are_means_over_people_and_shares_of_cells() -> None:
    figures = figures_of(cells())
    assert figures["VAF mean", "all"] == pytest.approx(260.0 / 3.0)
    assert figures["VAF least", "all"] == 80.0
    assert figures["J", "LRE"] == pytest.approx(0.3)
    assert figures["K per kg at 0", "all"] == pytest.approx(100.0 / 3.0)
    assert figures["B per kg at 0", "all"] == 0.0


def test_what_the_method_does_not_give_is_a_failure() -> None:
    table = cells()
    table.loc[0, ["stiffness_per_mass", "damping_per_mass", "inertia"]] = None
    figures = figures_of(table)
    assert figures["failed", "all"] == pytest.approx(100.0 / 3.0)
    assert figures["K per kg at 0", "all"] == 50.0


def test_printed_means_agree_with_the_mean_vaf_of_the_text() -> None:
    printed = printed_figures()
    points = [value for (title, _), value in printed.items() if title == "VAF"]
    assert sum(points) / len(points) == pytest.approx(printed["VAF mean", "all"], abs=0.05)


def test_a_line_holds_all_sources() -> None:
    table = table_of({"printed": printed_figures(), "realistic": figures_of(cells())})
    line = table[(table["quantity"] == "J") & (table["timing_point"] == "LRE")].iloc[0]
    assert (line["unit"], line["printed"]) == ("kg*m^2", 0.027)
    assert line["realistic"] == pytest.approx(0.3)
