"""
Does the set-up show what is added to the knee?
===============================================

An elastic band of known stiffness is put across the knee of a simulated person. Pulses without and
with it are explained as one leg (:func:`jointz.verify`): the difference must be the band. The
protocol ``verify`` is shortened here to one walk of each kind and three timing points.
"""

from tempfile import mkdtemp

import jointz
from jointz.core.protocols.protocol import Protocol
from jointz.io.protocols import load_protocol

raw = load_protocol("verify").model_dump(exclude_unset=True, mode="json")
raw["conditions"] = raw["conditions"][:4]
for condition in raw["conditions"]:
    if "perturbations" in condition:
        points = {"MST": 21.5, "TST": 40.5, "ISW": 68.5}
        condition["perturbations"] |= {"timing_points": points, "count_per_point": 24}
study = mkdtemp() + "/study"
jointz.run(Protocol.model_validate(raw), out=study, seed=2, preset="realistic", progress=False)

found = jointz.verify(study)
print(found.summary())

# %%
found.to_frame().round(3)

# %%
# The figure has what the addition states as 100 %.
axes = found.plot()
