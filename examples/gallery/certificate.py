"""
What error must this study expect?
==================================

:func:`jointz.certify` lets simulated people walk the protocol of the study and analyses them by its
method. The result is the error and the coverage to expect of **this** study, with its pulses,
sensors and calibration - if its people are like the simulated ones.
"""

from tempfile import mkdtemp

import jointz
from jointz.rig.session.simulate_study import simulate_study

study = simulate_study(mkdtemp() + "/study", participants=2, lag_sd_s=0.001, seed=9)
certificate = jointz.certify(study, people=8, seed=1)
print(certificate.summary())

# %%
certificate.to_frame().query("timing_point == 'all'").drop(columns="reasons").round(2)

# %%
# The study's people beside the simulated ones: outside the limits, nothing can be promised.
certificate.comparison_frame().round(2)

# %%
axes = certificate.plot()

# %%
# Error of stiffness, damping and inertia at every timing point.
