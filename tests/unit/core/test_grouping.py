"""Values by key."""

from jointz.core.grouping import by_key


def test_keys_and_values_keep_their_order():
    groups = by_key([("b", 1), ("a", 2), ("b", 3)])
    assert list(groups.items()) == [("b", [1, 3]), ("a", [2])]
    assert by_key([]) == {}
