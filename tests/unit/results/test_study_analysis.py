"""The tables, the text and the figure of a study's analysis."""

from jointz.core.events import GapRecord, PulseRecord, StrideRecord
from jointz.results.estimates import ESTIMATE_COLUMNS, CellEstimate, ParameterEstimate
from jointz.results.study_analysis import EXCLUDED_COLUMNS, StudyAnalysis


def cell(person, point, onset, value, status="ok", *, name="stiffness"):
    parameter = ParameterEstimate(name, value, None, None, status)
    return CellEstimate(person, point, onset, (parameter,), 95.0, 3, 1, "dissertation")


CELLS = (
    cell("S01", "LRE", 7.0, 50.0),
    cell("S01", "MST", 21.0, 60.0, "at_bound"),
    cell("S02", "LRE", 7.2, 55.0),
    cell("S02", "MST", None, None, "failed:no_pulses"),
    cell("S02", "TST", 40.0, None, "undecided"),
)


# --- tables --------------------------------------------------------------------------------------


def test_only_estimates_that_stand_are_counted_and_empty_tables_have_their_columns():
    assert StudyAnalysis(cells=CELLS, comparison=CELLS).n_standing == 3
    for frame in ("to_frame", "comparison_frame", "population_frame", "excluded_frame"):
        table = getattr(StudyAnalysis(cells=()), frame)()
        assert (len(table), len(table.columns) > 5) == (0, True)


def test_estimates_are_one_row_each_in_the_columns_of_the_file():
    table = StudyAnalysis(cells=CELLS).to_frame()

    assert tuple(table.columns) == ESTIMATE_COLUMNS
    assert table["status"].tolist() == [c.parameters[0].status for c in CELLS]
    assert table["value"].isna().tolist() == [False, False, False, True, True]
    assert set(table["unit"]) == {"N*m/rad"}


def test_whatever_was_left_out_is_one_table_pulses_first():
    analysis = StudyAnalysis(
        cells=(),
        pulses=(
            PulseRecord("S01", "a.csv", 1.0, 0.2, 5.0, "LRE"),
            PulseRecord(
                "S01",
                "a.csv",
                9.0,
                0.2,
                5.0,
                "MST",
                code="gap",
                detail="0.3 s",
                session="day 2",
                side="left",
            ),
        ),
        strides=(
            StrideRecord("S01", "a.csv", "perturbed", 0.5, 1.1),
            StrideRecord("S01", "a.csv", "perturbed", 1.6, 2.2, "missing_strike", "2.2 s"),
        ),
        gaps=(GapRecord("S01", "a.csv", 9.1, 0.3),),
    )

    table = analysis.excluded_frame()

    assert tuple(table.columns) == EXCLUDED_COLUMNS
    assert table.to_numpy().tolist() == [
        ["S01", "a.csv", 9.0, "MST", "pulse", "gap", "0.3 s", "day 2", "left"],
        ["S01", "a.csv", 1.6, "", "stride", "missing_strike", "2.2 s", "", ""],
    ]
    assert analysis.pulses_frame()["onset_s"].tolist() == [1.0, 9.0]
    assert analysis.strides_frame()["code"].tolist() == ["", "missing_strike"]


# --- text ----------------------------------------------------------------------------------------


# --- figure --------------------------------------------------------------------------------------


def test_walking_is_drawn_over_the_gait_cycle_and_a_cell_that_failed_moves_nothing():
    ax = StudyAnalysis(cells=CELLS).plot()
    ax.figure.canvas.draw()
    drawn = {str(line.get_label()): line.get_xydata().tolist() for line in ax.lines}

    assert drawn["S01"] == [[7.0, 50.0], [21.0, 60.0]]
    assert [7.2, 55.0] in drawn["S02"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("gait cycle (%)", "K (N·m/rad)")
