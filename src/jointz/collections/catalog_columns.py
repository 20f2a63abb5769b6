"""Columns of a collection's tables: printed values of an entry, and the catalog."""

from collections.abc import Mapping
from types import MappingProxyType

from jointz.core.plain_tables import Kind

#: Schema of the file ``catalog.parquet``.
CATALOG_SCHEMA = "jointz.Catalog/1"

#: Columns of the file of an entry's printed values: ``statistic`` is ``mean`` (over ``n`` people)
#: or ``individual`` (one participant).
PRINTED_COLUMNS = (
    "statistic", "participant", "timing_point", "onset_gait_pct", "parameter", "value", "unit",
    "sd", "n", "status", "source", "note",
)  # fmt: skip
#: Columns of ``catalog.parquet`` and their kind; one row is an estimate or a printed value.
CATALOG_COLUMNS: Mapping[str, Kind] = MappingProxyType({
    "entry": "text", "study": "text", "version": "text", "values": "text", "statistic": "text",
    "joint": "text", "side": "text", "positive": "text", "condition": "text", "activity": "text",
    "walking_speed_m_s": "number", "slope_deg": "number", "surface": "text",
    "participant": "text", "person": "text", "age_band": "text", "sex": "text",
    "mass_kg": "number", "height_m": "number", "group": "text",
    "timing_point": "text", "onset_gait_pct": "number", "parameter": "text", "value": "number",
    "unit": "text", "ci_low": "number", "ci_high": "number", "ci_level": "number",
    "sd": "number", "n": "number", "vaf_pct": "number", "n_used": "number",
    "n_excluded": "number", "with_stiffness": "number", "with_damping": "number",
    "with_inertia": "number", "method": "text", "status": "text", "software": "text",
    "torque_gain_sd": "number", "angle_gain_sd": "number", "raw_study": "text",
    "licence": "text", "consent": "text", "cite": "text", "source": "text", "session": "text",
})  # fmt: skip
