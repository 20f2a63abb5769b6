"""Files that are there whole or not at all."""

import pytest

from jointz.core.errors import WriteError
from jointz.core.whole_file import whole_file


def test_the_file_appears_when_the_block_has_ended(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("old")
    with whole_file(file) as partial:
        partial.write_text("new")
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_nothing_is_left_of_a_file_that_failed(tmp_path, error):
    def fill(partial):
        partial.write_text("half")
        raise error

    with pytest.raises(error), whole_file(tmp_path / "a.csv") as partial:
        fill(partial)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["x" * 300, "no-such-folder/a.csv"])
def test_what_the_system_refuses_is_told(tmp_path, name):
    told = r"cannot be written \((File name too long|No such file or directory)\)\. Elsewhere\."
    with (
        pytest.raises(WriteError, match=told),
        whole_file(tmp_path / name, "Elsewhere.") as partial,
    ):
        partial.write_text("lost")
