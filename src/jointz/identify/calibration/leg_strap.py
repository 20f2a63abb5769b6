"""What the exoskeleton's encoder moves more than the leg: strap and tissue under it."""

from collections.abc import Sequence

import numpy as np

from jointz.core.study import CalibrationSpec
from jointz.identify.calibration.hanging_model import FRICTION_GAIN, HangingCell, HangingPosterior
from jointz.identify.calibration.pulse_averages import PulseAverage
from jointz.results.bench.calibration_fit import CalibrationEntry, decided


def strap_entry(
    averages: Sequence[PulseAverage],
    cells: Sequence[HangingCell],
    best: HangingPosterior,
    known: CalibrationSpec,
) -> CalibrationEntry:
    """Return the compliance between encoder and joint.

    The motion of the joint is the model's, so that lag and tissue of the goniometer are out of
    it. The sd is that of an error of the angle's gain, of the scatter over pulses and of what
    the line leaves: inside a condition the error hardly changes, so that each counts once.
    """
    angle_gain, torque_gain = (
        1.0 if entry is None else entry.value for entry in (known.angle_gain, known.torque_gain)
    )
    gain_sd = 0.0 if known.angle_gain is None else known.angle_gain.sd
    apart, through, motions = [], [], []
    for average, cell, motion in zip(averages, cells, best.motions, strict=True):
        apart.append(average.motor_angle.mean(axis=0) - motion / angle_gain)
        total = cell.torque[0] + best.values[FRICTION_GAIN] * cell.torque[1]
        through.append(total / torque_gain)
        motions.append(motion)
    torque, motion = np.concatenate(through), np.concatenate(motions)
    # Along with the torque the joint moves: an error of its gain is not the strap's.
    columns = np.column_stack([torque, motion])
    inverse = np.linalg.pinv(columns)
    difference = np.concatenate(apart)
    value = float(inverse[0] @ difference)
    left = difference - columns @ (inverse @ difference)
    spread = float(np.std(left)) / float(np.std(torque))
    parts = {"model": spread, "angle_gain": abs(value) * gain_sd}
    return decided("strap_compliance", value, parts)
