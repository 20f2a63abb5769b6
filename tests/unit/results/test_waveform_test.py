"""What the result of a test over nodes says."""

import dataclasses

import pytest

from jointz.results.statistics.waveform_test import WaveformCluster, WaveformTest


def made(**changes) -> WaveformTest:
    test = WaveformTest(
        method="random_field",
        design="paired",
        n_a=10,
        n_b=10,
        df=9.0,
        alpha=0.05,
        threshold=4.3,
        threshold_from="random field",
        t=(0.0, 1.0, 5.0, -1.0),
        difference=(0.0, 1.0, 5.0, -1.0),
        ci_low=(-4.3, -3.3, 0.7, -5.3),
        ci_high=(4.3, 5.3, 9.3, 3.3),
        p=(1.0, 0.9, 0.01, 0.9),
        clusters=(WaveformCluster(1.825, 2.1167, 0.5, 2, 5.0, 0.02),),
        p_set=0.02,
        fwhm_nodes=0.58,
        resels=5.2,
    )
    return dataclasses.replace(test, **changes)


def nothing_found(**changes) -> WaveformTest:
    quiet = {"t": (0.0, 1.0, 2.0, -1.0), "clusters": (), "p_set": None}
    return made(**quiet | changes)


def test_the_curve_differs_where_t_is_beyond_the_threshold():
    test = made()
    assert test.different == (False, False, True, False)
    assert (test.verdict, test.p_value) == ("different", 0.01)


def test_without_a_margin_nothing_is_equivalent():
    test = nothing_found()
    assert test.verdict == "undecided"
    assert test.equivalent is None
    assert "equivalent" not in test.to_frame()


@pytest.mark.parametrize(
    ("margin", "nodes", "verdict"),
    [
        (4.0, 0, "undecided"),
        (5.3, 1, "undecided"),  # a band that touches the margin is not inside it
        (9.3, 3, "undecided"),
        (9.4, 4, "equivalent"),
    ],
)
def test_equivalent_is_a_band_inside_the_margin_at_every_node(margin, nodes, verdict):
    test = nothing_found(equivalence_margin=margin)
    assert sum(test.equivalent) == nodes
    assert test.verdict == verdict
    assert test.to_frame()["equivalent"].sum() == nodes


def test_tables_have_a_row_a_node():
    test = made()
    assert test.to_frame()["node"].tolist() == [0, 1, 2, 3]
    assert test.to_frame()["different"].tolist() == list(test.different)
