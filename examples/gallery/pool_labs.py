"""
Pool estimates of several labs
==============================

Rows of a catalog become people, people become studies, studies a mean with an interval and the
spread between labs, and a prediction for the next lab. The labs here are fictional.
"""

import numpy as np
import pandas as pd

from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.pool import pool_catalog

# %%
# Fictional people of four labs, stiffness at mid-stance, N*m/rad:

labs = {"lab-a": (62.0, 8), "lab-b": (54.0, 5), "lab-c": (71.0, 10), "lab-d": (60.0, 6)}
rng = np.random.default_rng(20)
about = {
    "version": "1", "values": "estimates", "statistic": "individual", "joint": "knee",
    "side": "left", "condition": "level", "activity": "walking", "walking_speed_m_s": 1.2,
    "slope_deg": 0.0, "timing_point": "MST", "onset_gait_pct": 21.5, "parameter": "stiffness",
    "unit": "N*m/rad", "method": "rigid", "status": "ok", "licence": "CC-BY-4.0",
    "ci_level": 0.95, "n": 1.0,
}  # fmt: skip
blank = {name: np.nan if kind == "number" else "" for name, kind in CATALOG_COLUMNS.items()}
rows = []
for lab, (mean, people) in labs.items():
    for number, value in enumerate(mean + 9.0 * rng.standard_normal(people)):
        own = {"entry": lab, "study": lab, "cite": f"{lab}, fictional", "participant": f"P{number}"}
        rows.append(
            blank | about | own | {"value": value, "ci_low": value - 6, "ci_high": value + 6}
        )
catalog = pd.DataFrame(rows)[list(CATALOG_COLUMNS)]

pool = pool_catalog(catalog)
print(pool.summary())

# %%
pool.to_frame().T.dropna().head(20)

# %%
axes = pool.plot()

# %%
# Each lab with its interval and its weight, and below the mean of labs. The interval for the mean
# is narrower than what to expect of a fifth lab.
