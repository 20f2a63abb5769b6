"""Parameters of a C3D file that become metadata, as text."""

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from jointz.io.c3d.c3d_parameters import Values

#: Parameter that lists points of one kind -> the parameter of their unit. What is in none of
#: them is a trajectory.
KINDS: Mapping[str, str] = {
    "ANGLES": "ANGLE_UNITS",
    "FORCES": "FORCE_UNITS",
    "MOMENTS": "MOMENT_UNITS",
    "POWERS": "POWER_UNITS",
    "SCALARS": "SCALAR_UNITS",
}
_TOLD = re.compile(
    r"POINT\.(USED|SCALE|RATE|DATA_START|FRAMES|LONG_FRAMES|LABELS|DESCRIPTIONS|UNITS"
    rf"|{'|'.join((*KINDS, *KINDS.values()))})\d*"
    r"|ANALOG\.(USED|RATE|FORMAT|BITS|GEN_SCALE|SCALE|OFFSET|LABELS|DESCRIPTIONS|UNITS)\d*"
    r"|EVENT\.(USED|TIMES|LABELS|CONTEXTS)\d*"
    r"|ROTATION\.(USED|DATA_START|RATE|RATIO|LABELS)\d*"
    r"|TRIAL\.ACTUAL_(START|END)_FIELD"
)


def metadata_of(parameters: Mapping[str, Values]) -> dict[str, str]:
    """Return parameters as text, but for those that became groups, signals or events."""
    return {
        name.lower(): text
        for name, values in parameters.items()
        if not _TOLD.fullmatch(name) and (text := _text(values)) not in ("", "[]")
    }


def _text(values: Values) -> str:
    """Write a parameter as text: one value plainly, several as in JSON."""
    if isinstance(values, tuple):
        return values[0] if len(values) == 1 else json.dumps(list(values), ensure_ascii=False)
    plain: Any = values.tolist()
    if values.dtype.kind == "f":
        short = [float(str(v)) for v in values.astype(np.float32).ravel()]
        plain = np.array(short).reshape(values.shape).tolist()
    return json.dumps(plain if values.size != 1 else np.ravel(plain)[0].item())
