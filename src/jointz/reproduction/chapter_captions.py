"""What stands below the figures of chapters, and beside which table each stands."""

from typing import Final

#: Table -> the figures that show it.
FIGURES_OF_TABLE: Final = {
    "bandwidth": ("figure_2_5",),
    "intrinsic": ("figure_intrinsic",),
    "pairs": ("figure_2_6", "figure_pairs"),
    "mechanisms": ("figure_mechanisms",),
    "torque_models": ("figure_3_3",),
    "chirp": ("figure_3_4",),
    "static": ("figure_3_5",),
    "perturbation": ("figure_3_6",),
    "replicates": ("figure_replicates",),
    "accuracy": ("figure_4_2",),
    "means": ("figure_4_4", "figure_a_1"),
    "simulated_statistics": ("figure_4_3",),
    "pilot": ("figure_3_7",),
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
    "figure_3_7": (
        "3.7",
        "The pilot on two simulated people, side by side for clarity, and their mean (large). "
        "Circles: the pilot\N{RIGHT SINGLE QUOTATION MARK}s method, one bounded fit to the average "
        "response; diamonds: recommended method; bars: 95 % interval of a person; grey: truth. "
        "Dashed: printed largest and smallest average of two other people. Where a person's "
        "estimate was refused there is no mark and no mean.",
    ),
    "figure_4_2": (
        "4.2",
        "Knee angle and torque of the device over the gait cycle of the ninth simulated person, "
        "walking with the device at zero torque: every stride (grey) and their mean. Torque is "
        "computed from motor current by equation 4.1: what friction and inertia of the device "
        "leave, not the moment of the knee.",
    ),
    "figure_4_3": (
        "4.3",
        "Above: paired t of the mean angle without and with the device over the gait cycle, people "
        "being counted; dashed, the threshold by random field theory; dotted, by flipping signs; "
        "grey, the printed one. Red where t is beyond the first. Below: the mean angles over "
        "people, and their difference with a 95 % band that holds at all nodes at once beside a "
        "margin of 5 degrees. A t inside the thresholds does not show that the device changes "
        "nothing: the band says what remains open.",
    ),
    "figure_4_4": (
        "4.4",
        "Impedance over the gait cycle. Open triangles: mean and standard deviation over the "
        "printed people; circles: the dissertation's method on ten simulated people, likewise; "
        "diamonds: recommended method, mean of the population with 95 % interval; grey: mean truth "
        "of the simulated people. Crosses (offset for clarity): quasi-stiffness that the printed "
        "percent differences imply. Bars: Pfeifer, two to three times the printed mean, the only "
        "value of others that the text states. Printed inertia is of device and joint together, "
        "the simulated one of the joint.",
    ),
    "figure_a_1": (
        "A.1",
        "Stiffness beside other studies. Above as in figure 4.4. Below: what the text says of each "
        "study's stiffness beside the dissertation's; a dash where it says nothing. Their values "
        "are printed as a figure only, without numbers; the bars are the printed factor times the "
        "printed mean.",
    ),
    "figure_pairs": (
        "4.A",
        "Differences between timing points, one value a person and timing point: mean with 95 % "
        "interval, pooled error, Bonferroni over 15 pairs. Full marks differ here. Shaded: 20 % "
        "of the grand mean on both sides of nothing. Dotted: the difference that 50 rows a cell "
        "taken as independent would find, at the middle of the scatters with which all printed "
        "statements come out; consistent with replicates taken as people, not proof of it.",
    ),
    "figure_replicates": (
        "4.B",
        "Studies simulated without an effect of the timing point. Left: share of studies with a p "
        "smaller than the abscissa. Right: share with p < 0.001 over the scatter of rows in a "
        "cell, which is not printed; bars: scatter with which all printed statements of K, B and "
        "J come out of the published tables.",
    ),
}
