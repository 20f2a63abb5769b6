"""What stands below the figures of chapters, and beside which table each stands."""

from typing import Final

#: Table -> the figures that show it.
FIGURES_OF_TABLE: Final = {
    "bandwidth": ("figure_2_5",),
    "intrinsic": ("figure_intrinsic",),
    "pairs": ("figure_2_6",),
    "mechanisms": ("figure_mechanisms",),
    "torque_models": ("figure_3_3",),
    "chirp": ("figure_3_4",),
    "static": ("figure_3_5",),
    "perturbation": ("figure_3_6",),
}
#: Figure -> number (a letter where the dissertation has none) and what is seen.
CAPTIONS: Final = {
    "figure_2_5": (
        "2.5",
        "Closed-loop gain of the torque loop at two amplitudes, over its gain at low frequency, "
        "and the coherence of command and torque. Dots with bars: where the gain has fallen by 3 "
        "dB from that, with 95 % interval; crosses: the "
        "same read off a Blackman-Tukey spectrum of 30 lags (dashed); open triangles: printed. "
        "Bandwidths closer than the resolution of a spectrum cannot be told apart by it.",
    ),
    "figure_intrinsic": (
        "2.A",
        "Intrinsic impedance of the exoskeleton, output free: measured frequency response (dots) "
        "and the second-order model with the recommended estimates (line). The dissertation made "
        "this comparison (2.2.2) and did not print it.",
    ),
    "figure_2_6": (
        "2.6",
        "Stiffness, damping and inertia of every load, trajectories A to E from light to dark. "
        "Circles: dissertation's method, mean and standard deviation over pulses; diamonds: "
        "recommended method with its 95 % interval; grey lines: truth. In stiffness and inertia "
        "every panel spans the same percentage of its truth, in damping the same range.",
    ),
    "figure_mechanisms": (
        "2.B",
        "What each mechanism alone does to the dissertation's method: mean error over cases 1 to "
        "4. Several make inertia alone as low as printed; the text above says which make both "
        "printed averages.",
    ),
    "figure_3_3": (
        "3.3",
        "Torque of the three models against the torque sensor (above), and what is left (below), "
        "by direction of motion. Friction that a model lacks splits its remainder by direction.",
    ),
    "figure_3_4": (
        "3.4",
        "Torque sensor and torque model 3.3 during the four chirps: a stretch of each, and the RMS "
        "error over the whole chirp.",
    ),
    "figure_3_5": (
        "3.5",
        "Torque against deflection with the output locked, by the sensor and by the model, and the "
        "line fitted to each (left); the same less the line of the sensor (right).",
    ),
    "figure_3_6": (
        "3.6",
        "Stiffness of the springs while the position motor moves them, printed (open) beside ours "
        "(filled). Bars: standard deviation over pulses; of the recommended estimate the 95 % "
        "interval. Grey line: truth.",
    ),
}
