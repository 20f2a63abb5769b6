"""
Pool the results of several labs
================================

People become studies, studies a mean with an interval and the spread between labs, and a
prediction for the next lab. The labs here are fictional: their results folders are written by
hand, as far as pooling reads them.
"""

import json
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pandas as pd

import jointz

# %%
# Fictional people of four labs, stiffness at mid-stance, N*m/rad:

labs = {"lab-a": (62.0, 8), "lab-b": (54.0, 5), "lab-c": (71.0, 10), "lab-d": (60.0, 6)}
rng = np.random.default_rng(20)
root = Path(mkdtemp())
for lab, (mean, people) in labs.items():
    value = mean + 9.0 * rng.standard_normal(people)
    ids = [f"S{k}" for k in range(people)]
    table = pd.DataFrame({
        "participant": ids, "timing_point": "MST", "onset_gait_pct": 21.5,
        "parameter": "stiffness", "value": value, "unit": "N*m/rad", "ci_low": value - 6,
        "ci_high": value + 6, "ci_level": 0.95, "vaf_pct": 99.0, "n_used": 50, "n_excluded": 0,
        "method": "bayesian", "status": "ok",
    })  # fmt: skip
    study = {"joint": "knee", "kind": "walking", "positive": "flexion", "recordings": [],
             "participants": [{"id": name} for name in ids]}  # fmt: skip
    (root / lab).mkdir()
    table.to_csv(root / lab / "estimates.csv", index=False)
    provenance = {"study": study, "settings": {"window_s": 0.1}, "study_sha256": lab}
    (root / lab / "provenance.json").write_text(json.dumps(provenance))

pooled = jointz.pool([root / lab for lab in labs])
print(pooled.summary())

# %%
pooled.to_frame().T.dropna().head(20)

# %%
axes = pooled.plot()

# %%
# Each lab with its interval and its weight, and below the mean of labs. The interval for the mean
# is narrower than what to expect of a fifth lab.
