"""
Do timing points differ?
========================

The table of the dissertation, one value a participant and timing point, in a mixed model with
people as a random factor: F test with Kenward and Roger's degrees of freedom, pairs, sphericity.
"""

from jointz.reference.chapter4 import participant_table
from jointz.stats import mixed_model

fit = mixed_model(
    participant_table(),
    response="stiffness_per_mass",
    within="timing_point",
    participant="participant",
)
print(fit.summary())

# %%
# Which pairs differ, as published (one error for all pairs, Bonferroni) and with an error of each
# pair's own (Holm):

fit.pairs("bonferroni").round(3)

# %%
fit.pairs("holm", error="paired").round(3)

# %%
axes = fit.plot()

# %%
# Loading response differs from mid-stance and from both points of swing, no other pair does, with
# the pooled error. Pairs vary unlike, so read the corrected p of the summary and the paired table
# too.
