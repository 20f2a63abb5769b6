"""
Trap 14: is that stiffness or a reflex?
=======================================

About 40 ms after a stretch the muscle answers, and a model without reflex calls the answer
stiffness and damping. A record with random stretches in both directions tells the two apart,
because the reflex comes late and answers one direction only. Pulses of one direction do not.
"""

from dataclasses import replace
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, lfilter, sosfilt

import jointz
from jointz.demo.demo_study import truth_table
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.presets import JointSettings, ReflexSettings, preset

K, B, J = 60.0, 1.0, 0.015
RATE = 1000.0
DELAY = 40  # samples of 1 ms


def record(gain, seed=14):
    """Return angle and torque of an ankle with a stretch reflex of this gain."""
    rng = np.random.default_rng(seed)
    angle = (
        np.radians(4.0)
        * sosfilt(butter(2, 10.0, fs=RATE, output="sos"), rng.standard_normal(40_000))
        * 5.0
    )
    velocity = np.gradient(angle, 1 / RATE)
    passive = K * angle + B * velocity + J * np.gradient(velocity, 1 / RATE)
    stretch = np.maximum(np.roll(velocity, DELAY), 0.0)
    answer = gain * lfilter(*butter(2, 4.0, fs=RATE), stretch)
    return angle, passive + answer + 0.1 * rng.standard_normal(angle.size)


# %%
# The stiffness that both models find, the stronger the reflex:

gains = np.array([0.0, 4.5, 9.0])
found = {"kbj": [], "reflex": []}
for gain in gains:
    angle, torque = record(gain)
    for model, values in found.items():
        fit = jointz.identify_joint(
            angle=angle, torque=torque, rate_hz=RATE, input="angle", model=model
        )
        values.append(fit.parameter("stiffness").value)
        if gain == gains[-1]:
            print(fit.summary(), "\n")

# %%
# Somebody walks with pulses in one direction. The reflex is of the stretch's velocity, 30 ms late,
# and as strong as none, 30 % or all of the stiffness; estimated as always:

shares = np.array([0.0, 0.3, 1.0])
walking = []
for share in shares:
    reflex = ReflexSettings(gain=share, latency_s=0.03) if share else None
    people = replace(preset("nominal"), name="reflex", joint=JointSettings(reflex=reflex))
    study = simulate_study(mkdtemp() + "/study", preset=people, lag_sd_s=0.0005, seed=14)
    analysis = jointz.analyze(study, resamples=2)
    rows = truth_table(analysis, study).query("parameter == 'stiffness'")
    walking.append(rows["error_pct"].to_numpy())
    print(
        f"reflex of {100 * share:.0f} % of K: {len(rows)} of {len(analysis.cells)} decided, "
        f"mean error {rows['error_pct'].mean():+.0f} %, "
        f"intervals that hold the truth {100 * rows['covered'].mean():.0f} %"
    )

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(7.6, 3.4))
for model, label in {"kbj": "one joint", "reflex": "joint and reflex"}.items():
    left.plot(gains, found[model], "o-", label=label)
left.axhline(K, color="0.6", linewidth=0.8)
left.set(xlabel="Reflex gain (N*m*s/rad)", ylabel="Stiffness found (N*m/rad)")
left.set_title("random stretches both ways", fontsize="small")
left.legend()
for share, errors in zip(shares, walking, strict=True):
    right.plot(np.full(errors.size, 100 * share), errors, ".", color="0.6")
right.plot(100 * shares, [errors.mean() for errors in walking], "o-", color="C0")
right.axhline(0.0, color="0.6", linewidth=0.8)
right.set(xlabel="Reflex (% of the stiffness)", ylabel="Error of the stiffness (%)")
right.set_title("walking, pulses of one direction", fontsize="small")

# %%
# Left: without a reflex both models agree. The stronger it is, the further the stiffness of the
# simple model is from the grey line; the other stays near. Right: pulses of one direction and one
# size cannot tell. As many estimates are available as without a reflex, and they go up with it. The
# intervals allow for a usual reflex, but not for one as strong as the joint. Push both ways where
# reflexes matter.
