"""How far classical values were off in simulated people: ``python -m benchmarks.classical``."""

#: Kind of pulse -> parameter -> root mean square of the errors of all values given, %: the smallest
#: and the largest of several simulators.
RMS_PCT = {
    "hold": {"stiffness": (26.0, 59.0), "damping": (65.0, 82.0), "inertia": (20.0, 30.0)},
    "short": {"stiffness": (19.0, 38.0), "damping": (31.0, 41.0), "inertia": (17.0, 18.0)},
    "doublet": {"stiffness": (34.0, 54.0), "damping": (30.0, 39.0), "inertia": (20.0, 59.0)},
}
#: Kind of pulse -> number of simulators.
SIMULATORS = {"hold": "two", "short": "two", "doublet": "three"}
