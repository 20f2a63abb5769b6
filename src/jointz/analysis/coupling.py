"""Coupling of device and leg, where a walking study does not state it."""

from typing import Any

from jointz.core.errors import DataError
from jointz.core.study import Study
from jointz.io.small_files import read_json

_TRUTH_FILE = "ground_truth.json"


def ask_for_coupling(study: Study) -> None:
    """Refuse a simulated study of rigid coupling that was written before the key existed."""
    if study.spec.kind != "walking" or study.spec.coupling is not None:
        return
    preset = _rigid_preset(study)
    if preset is not None:
        raise DataError(
            f"{study.root / 'study.toml'}: coupling is missing, and {_TRUTH_FILE} names the "
            f'simulated people "{preset}", to whom the device is coupled rigidly. Add the line '
            'coupling = "rigid" above the first [table] of study.toml.'
        )


def _rigid_preset(study: Study) -> str | None:
    """Return the name of a preset without strap; None where the study is of other people."""
    try:
        truth: Any = read_json(study.root / _TRUTH_FILE, "")
        conditions = [c for person in truth["participants"].values() for c in person.values()]
        bodies = [condition["settings"]["body"] for condition in conditions]
        preset = str(truth["preset"])
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    return preset if bodies and not any(bodies) else None
