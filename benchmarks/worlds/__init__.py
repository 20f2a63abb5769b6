"""A simulated world of the knee where impedance follows from muscles, not from K, B and J.

The world tests estimators. Its authors did not read the estimators of this package, and it
imports nothing from the package.

Physics
-------
Rigid bodies: MuJoCo steps (0.5 ms) a planar chain of pelvis and trunk (free horizontally and
vertically), thigh, shank and foot (masses, lengths, inertias: Winter 2009, table 4.1) and the arm
of a device that turns about the knee. Trunk, hip and ankle are held around their reference motion
by springs and dampers (other leg, hip and ankle muscles); feedforward from inverse dynamics makes
the reference motion a solution. Stance is an equivalent of contact: the published ground reaction
force acts at a centre of pressure chosen such that the knee moment is the published one, and pads
of a sole (springs and dampers scaled by the load) hold the foot where it landed, also against
rotation while the foot is flat. The trunk above the loaded leg gives the knee a negative
stiffness.

Muscles: vasti, rectus femoris, hamstrings, gastrocnemius and short head of biceps (Hill type;
Geyer and Herr 2010, Arnold et al. 2010 for sizes): activation dynamics, force-length, force-
velocity, exponential tendons (Thelen 2003), arms that depend on the angle, and cross-bridges that
add a short-range stiffness of 23.4 F / l_opt (Cui et al. 2008), slip after about 1.2 % of fibre
length and detach within 120 ms. Passive torque of the knee: Riener and Edrich 1999.

Control: excitations over the gait cycle from bursts of EMG (Winter and Yack 1987; Perry and
Burnfield 2010), corrected by static optimisation and inverted through tendon and activation.
Spindles (fibre length and speed, threshold, gain that rises with excitation) excite their own
muscle after 27 to 48 ms (plus activation) and inhibit the antagonist, relative to the drive of
the nominal stride. A slow correction of the knee angle (delay 75 to 90 ms) acts through the same
excitations; without it the loaded knee gives way within some strides. Nothing but muscles,
passive tissue and the device acts on the knee.

Variation: stride time, excitations and hip motion vary as sums of Ornstein-Uhlenbeck processes
(0.08 s to 40 s).

Device: motor with limited bandwidth (about 35 Hz) and friction, torque sensor behind that
friction, an arm with mass and inertia whose own bearing has friction that the sensor does not
see, and a cuff that hardens with deflection. Goniometer and gyroscopes sit on soft skin (base-
excited mass on a spring), with gain errors, lags, noise and (goniometer) drift. `calibration`
knows gains and lags of instruments with an error, but nothing of skin, cuff or friction.

Definitions of the true values: `truth.DEFINITIONS`, also written to `truth.json`.

Left out
--------
Frontal plane, real contact with slip and lift-off, changes of gait after a pulse other than by
reflexes and the slow correction, thigh cuff of the device (its thigh part is rigid on the thigh),
fatigue, history dependence beyond the short range, Golgi tendon organs, cross-talk of torque and
skin, missing data, misaligned axes.
"""
