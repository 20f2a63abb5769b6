"""What a report says of the experiment behind a study."""

import pytest

from jointz.core.run_report import RunReport
from jointz.report.run_section import run_section


@pytest.mark.parametrize(
    ("clamped", "told"),
    [
        (0, "900 ticks, missed 2 slots and cut no torque."),
        (7, "900 ticks, missed 2 slots, and sent less torque than was asked for in 7 ticks."),
    ],
)
def test_torque_that_was_cut_is_told(clamped, told):
    timing = {"participant": "S01", "ticks": 900, "missed_slots": 2, "clamped_ticks": clamped}
    section = run_section(RunReport("walking", 1, (), (), (timing,)))
    assert told in section["timing"]
