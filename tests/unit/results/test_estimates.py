"""One cell of an analysis and its parameters."""

import numpy as np
import pytest

from jointz.results.estimates import ESTIMATE_COLUMNS, CellEstimate, ParameterEstimate, Response


def response(n: int = 3, **changes) -> Response:
    values = dict.fromkeys(("time_s", "angle", "torque", "fitted_torque"), np.arange(float(n)))
    return Response(**(values | changes))


STIFFNESS = ParameterEstimate("stiffness", 50.0, 45.0, 55.0, "ok")
INERTIA = ParameterEstimate("inertia", None, None, None, "undecided")
CELL = CellEstimate("S01", "LRE", 7.1, (STIFFNESS, INERTIA), 97.0, 40, 10, "dissertation")


@pytest.mark.parametrize(
    ("status", "stands"),
    [("ok", True), ("at_bound", True), ("undecided", False), ("failed:no_pulses", False)],
)
def test_an_estimate_stands_where_there_is_a_value_to_use(status, stands):
    assert ParameterEstimate("stiffness", 1.0, 0.0, 2.0, status).available is stands


def test_a_cell_is_one_row_a_parameter():
    rows = CELL.rows()

    assert [tuple(row) for row in rows] == [ESTIMATE_COLUMNS] * 2
    assert list(rows[0].values()) == [
        "S01", "LRE", 7.1, "stiffness", 50.0, "N*m/rad", 45.0, 55.0, 0.95, 97.0, 40, 10,
        "dissertation", "ok", "", "",
    ]  # fmt: skip
    assert (rows[1]["value"], rows[1]["status"]) == (None, "undecided")


def test_responses_are_equal_where_all_their_samples_are():
    nan = np.array([0.0, np.nan, 2.0])

    assert response() == response()
    assert response(angle=nan) == response(angle=nan.copy())
    assert response() != response(torque=np.ones(3))
    assert response() != response(4)
    assert response() != "response"
