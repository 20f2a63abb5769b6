"""
Trap 4: which one causes the other?
===================================

Torque from outside moves the joint; muscles inside move it too. Regressing torque on angle takes
everything that the angle did for an effect of the measured torque, and the stiffness comes out
low. Fits in the right direction, or with the commanded torque as instrument, do not care.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, csd, sosfilt, welch

import jointz
from jointz.rig.sim.walking.knee_joint import respond

TRUTH = {"stiffness": 60.0, "damping": 1.5, "inertia": 0.05}
RATE = 500.0


def noise(rng, rms, cutoff_hz):
    """Return a random torque below a frequency, N*m."""
    shaped = sosfilt(butter(2, cutoff_hz, fs=RATE, output="sos"), rng.standard_normal(60_000))
    return rms * shaped / shaped.std()


def reading(fit, name):
    """Return what a fit reads, also where jointz calls it undecided and gives no value."""
    parameter = fit.parameter(name)
    return parameter.unbounded if parameter.value is None else parameter.value


def by_cross_spectrum(angle, torque):
    """Return K, B, J of the frequency response (1.2), torque over angle, from 0.5 to 10 Hz."""
    frequency, cross = csd(angle, torque, RATE, nperseg=1000)
    response = cross / welch(angle, RATE, nperseg=1000)[1]
    inside = (frequency >= 0.5) & (frequency <= 10.0)
    w, response = 2 * np.pi * frequency[inside], response[inside]
    columns = np.column_stack([np.ones(w.size), 1j * w, -(w**2)])
    rows = np.concatenate([columns.real, columns.imag])
    return np.linalg.lstsq(rows, np.concatenate([response.real, response.imag]), rcond=None)[0]


# %%
# 4 N*m below 20 Hz from outside and, unseen, 1 N*m below 2 Hz from inside. Ten records of two
# minutes.

ways = {
    "torque on angle": {"estimator": "least_squares"},
    "angle on torque": {"estimator": "admittance"},
    "instrument:\ncommand": {"estimator": "instrumental_variable"},
}
CROSS = "cross-spectrum\nover that of the angle"
errors = {"torque on angle": [], CROSS: [], "angle on torque": [], "instrument:\ncommand": []}
for seed in range(10):
    rng = np.random.default_rng(seed)
    torque, muscle = noise(rng, 4.0, 20.0), noise(rng, 1.0, 2.0)
    angle, _ = respond(torque + muscle, *TRUTH.values(), rate_hz=RATE)
    for name, way in ways.items():
        fit = jointz.identify_joint(angle=angle, torque=torque, command=torque, rate_hz=RATE, **way)
        errors[name].append([100 * (reading(fit, p) / true - 1) for p, true in TRUTH.items()])
    found = by_cross_spectrum(angle, torque)
    errors[CROSS].append(
        [100 * (p / true - 1) for p, true in zip(found, TRUTH.values(), strict=True)]
    )

# %%
figure, axes = plt.subplots(figsize=(7.2, 3.4))
for at, name in enumerate(errors):
    values = np.array(errors[name])
    for shift, parameter in enumerate(TRUTH):
        x = np.full(len(values), at + 0.2 * (shift - 1))
        axes.scatter(
            x, values[:, shift], s=14, color=f"C{shift}", label=parameter if not at else None
        )
axes.axhline(0.0, color="0.6", linewidth=0.8)
axes.set_xticks(range(len(errors)), list(errors))
axes.set_ylabel("Error (%)")
axes.legend()
for name in errors:
    print(
        " ".join(name.split()),
        np.round(np.mean(errors[name], axis=0), 1),
        "% mean error of K, B, J",
    )

# %%
# Torque on angle reads the stiffness and the inertia low in every record, sample by sample or
# frequency by frequency; the other two scatter about the truth. Where the device has impedance of
# its own only the instrument is left.
