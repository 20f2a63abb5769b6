"""Answers entered into a study file."""

import copy
import json
from itertools import pairwise
from typing import Any

Study = dict[str, Any]


def answered(study: Study, about: str, value: Any) -> Study:
    """Return a study with one answer in it; None removes the key."""
    study = copy.deepcopy(study)
    keys = about.replace("]", "").replace("[", ".").split(".")
    here: Any = study
    for key, after in pairwise(keys):
        here = _child(here, key, after)
    last: Any = int(keys[-1]) if isinstance(here, list) and keys[-1].isdigit() else keys[-1]
    if isinstance(here, list) and isinstance(last, str):
        here = here[0]
    if value is None:
        here.pop(last, None)
    elif isinstance(value, dict) and isinstance(here.get(last), dict):
        here[last] |= value
    elif _is_channel(keys) and not isinstance(value, dict):
        here.setdefault(last, {})["column"] = value
    else:
        here[last] = value
    return study


def _is_channel(keys: list[str]) -> bool:
    return len(keys) == 2 and keys[0] == "channels"


def _child(here: Any, key: str, after: str) -> Any:
    """Return the table below a key; the first of a list unless a number follows."""
    child = here[int(key)] if isinstance(here, list) else here.setdefault(key, {})
    return child[0] if isinstance(child, list) and not after.isdigit() else child


def study_text(study: Study) -> str:
    """Return a study as TOML, with inline tables."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in study.items())


def _key(key: str) -> str:
    return json.dumps(key, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return str(value).lower() if isinstance(value, bool) else repr(value)
