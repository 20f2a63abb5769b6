"""
How good is torque from the motor current?
==========================================

A quasi-direct drive without a torque sensor has its torque computed from the current. On a bench
with a sensor, :func:`jointz.identify_actuator` fits three models: current only (3.1), with
viscous friction and inertia (3.2), with Coulomb and gear friction (3.3).
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt

import jointz
from jointz.io.formats.netcdf_recording import read_recording
from jointz.reference import chapter3

# %%
# The bench of the dissertation, simulated: seven torques by six speeds, three and a half minutes.

done = jointz.run("qdd-torque-speed", out=mkdtemp() + "/levels", seed=1)
record = read_recording(done.study / "springs_levels.nc").isel(time=slice(None, None, 4))
fits = {
    model: jointz.identify_actuator(
        current=record["current"].to_numpy(),
        velocity=record["motor_velocity"].to_numpy(),
        torque=record["sensor_torque"].to_numpy(),
        time=record["time"].to_numpy(),
        gear_ratio=9.0,
        model=model,
    )
    for model in ("current", "motor", "friction")
}
print(fits["friction"].summary())

# %%
figure, axes = plt.subplots()
names = list(fits)
bars = axes.bar(names, [fit.rms_error_nm for fit in fits.values()])
axes.bar_label(bars, fmt="%.2f", padding=2)
printed = [chapter3.TORQUE_RMS[key].value for key in chapter3.TORQUE_RMS]
axes.plot(names, printed, "kx", label="printed, table 3.1")
axes.set(xlabel="Torque model", ylabel="RMS error (N*m)")
axes.legend()

# %%
# Friction that turns its sign with the velocity is what the simple models miss: only the third
# comes down to the noise of the sensor.
