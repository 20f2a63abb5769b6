"""Labels that a reader takes for one."""

import pytest

from jointz.results.statistics.comparison_labels import alike_labels, label_key


@pytest.mark.parametrize(
    ("one", "other", "alike"),
    [
        ("S01", "s1", True), ("S001", "S01", True), ("1", "1.0", True), ("1e3", "1000", True),
        ("Sub-007 b", "sub-7 B", True), ("S10", "S1", False), ("S100", "S10", False),
        ("0", "00", True), ("nan", "NA", False), ("1234567", "1234568", False),
        ("1.05", "1.5", False),
    ],
)  # fmt: skip
def test_case_leading_zeros_and_the_way_of_a_number_do_not_count(one, other, alike):
    assert (label_key(one) == label_key(other)) == alike
    assert alike_labels([one, other]) == ([(one, other)] if alike else [])


def test_a_label_that_stands_often_is_one():
    assert alike_labels(["a", "a", "b"]) == []
