"""What a report says of the experiment behind a study."""

from jointz.analysis.page.report_page import run_section
from jointz.results.run_report import RunReport


def test_an_old_report_has_whole_counts_and_says_where_there_is_no_onset():
    row = dict.fromkeys(("planned", "completed", "n"), 3) | {"missed": 2, "aborted": 0}
    row |= {"participant": "S01", "condition": "perturbed", "planned_pct": 7.0}  # no n_missing
    known = {"error_mean_pct": 0.1, "error_sd_pct": 1.5, "theory_sd_pct": 1.4}
    rows = [row | known | {"timing_point": name} for name in ("LRE", "LRE", "single", "none")]
    rows[2] |= {"n": 1, "error_sd_pct": None}
    rows[3] |= {"n": 0, "error_mean_pct": None, "error_sd_pct": None}
    timing = {"participant": "S01", "ticks": 900, "missed_slots": 2, "clamped_ticks": 0}
    report = RunReport("walking", 1, tuple(rows), (), (timing,))
    assert [
        f"{r['completed']} of {r['planned']}, {r['n']} ({r['n_missing']})"
        for r in run_section(report)["rows"]
    ] == ["6 of 6, 6 (0)", "3 of 3, 1 (0)", "3 of 3, 0 (0)"]


def test_only_withdrawn_pulses_are_called_withdrawn():
    """A pulse may also be missing because the log was damaged."""
    row = {"participant": "S01", "condition": "perturbed", "timing_point": "LRE", "planned": 4}
    row |= {"planned_pct": 7.0, "completed": 3, "n": 0}
    one_less = RunReport("walking", 1, (row | {"withdrawn": 0},), (), ())
    older = RunReport("walking", 1, (row,), (), ())
    assert one_less.withdrawn_text == older.withdrawn_text == ""
    assert "withdrawn" not in one_less.summary() + older.summary()
    withdrawn = RunReport("walking", 1, (row | {"withdrawn": 1},), (), ())
    assert "1 pulse was withdrawn" in withdrawn.summary()
