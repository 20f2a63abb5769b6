"""
What error must this study expect?
==================================

:func:`jointz.certify` puts known responses into the study's own unperturbed strides and estimates
them like real ones. The result is the error and the coverage to expect of **this** study, with
its people, its noise and its number of pulses.
"""

from tempfile import mkdtemp

import jointz
from jointz.session.simulate_study import simulate_study

study = simulate_study(mkdtemp() + "/study", lag_sd_s=0.001, seed=9)
certificate = jointz.certify(study, replicates=15, seed=1)
print(certificate.summary())

# %%
certificate.to_frame().query("timing_point == 'all'").round(2)

# %%
axes = certificate.plot()

# %%
# Error of stiffness, damping and inertia at every timing point. In swing the stiffness is the
# worst known: it is small there, and the leg swings on.
