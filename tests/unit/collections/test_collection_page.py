"""The example of docs/collections.md is an entry."""

import re
import tomllib
from pathlib import Path

import pytest

from jointz.collections.entry_model import Entry

PAGE = (Path(__file__).parents[3] / "docs" / "collections.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", re.findall(r"^```toml entry\n(.*?)^```", PAGE, re.DOTALL | re.M))
def test_the_example_is_an_entry(text):
    assert Entry.model_validate(tomllib.loads(text)).kind == "estimates"
