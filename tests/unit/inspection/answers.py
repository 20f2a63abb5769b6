"""Answers to what a draft of jointz inspect leaves open."""

import json
import re

USUAL = {
    "positive": "flexion",
    "torque_acts_on": "joint",
    "unit": "N*m",
    "condition": "unperturbed",
    "kind": "bench",
    "id": "S01",
    "participant": "S01",
    "first_sample": 1,
    "sample_rate_hz": 1000.0,
}


def open_keys(toml):
    """Return the keys of a draft that have no answer, in order."""
    return re.findall(r'^(\w+) = "\?"', toml, re.MULTILINE)


def answered(toml, **answers):
    """Answer what is open: as given, else as is usual; what has no usual answer stays open."""

    usual = USUAL | dict(re.findall(r'^(positive) = "(\w+)"', toml, re.MULTILINE)[:1])

    def line(found):
        return f"{found[1]} = {json.dumps((usual | answers).get(found[1], '?'))}"

    return re.sub(r'^(\w+) = "\?".*$', line, toml, flags=re.MULTILINE)
