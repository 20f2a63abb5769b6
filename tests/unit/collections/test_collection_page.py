"""docs/collections.md names every key and every code, and its example is an entry."""

import re
import tomllib
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from jointz.collections.entry_model import CalibrationSpec, Entry

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "collections.md").read_text(encoding="utf-8")
SOURCES = [
    *(ROOT / "src/jointz/collections/checking").glob("*check*.py"),
]
WORDS = {
    word for code in re.findall(r"`([^`\n]+)`", PAGE) for word in re.split(r"[\s,=.{}\[\]]+", code)
}


def keys(model):
    """Return the keys of a model and of all that stand inside it; calibrations have a page."""
    for name, field in model.model_fields.items():
        yield name
        inner = [field.annotation, *get_args(field.annotation)]
        for part in inner:
            is_model = isinstance(part, type) and issubclass(part, BaseModel)
            if is_model and not issubclass(part, CalibrationSpec):
                yield from keys(part)


def test_every_key_is_described():
    assert set(keys(Entry)) - WORDS == set()


def test_every_code_is_described():
    text = "".join(source.read_text(encoding="utf-8") for source in SOURCES)
    before = r"yield|return|Check\(|_rule\(|Finding\([a-z.]+,|^ +\*?\(+.*,"
    codes = set(re.findall(rf'(?:{before})\s*"([a-z]+_?[a-z_]+)",', text, re.MULTILINE))

    assert {"unit", "side_missing", "row_twice", "person_twice", "mass_range"} <= codes
    assert len(codes) > 50
    assert codes - WORDS == set()


@pytest.mark.parametrize("text", re.findall(r"^```toml entry\n(.*?)^```", PAGE, re.DOTALL | re.M))
def test_the_example_is_an_entry(text):
    assert Entry.model_validate(tomllib.loads(text)).kind == "estimates"
