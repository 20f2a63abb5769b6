"""Responses of a participant and their explanation by the recommended method."""

from dataclasses import dataclass

from jointz.core.study import CalibrationSpec
from jointz.identify.prediction.predicted_cells import PredictedCell
from jointz.identify.recommended.response_model import CellResponse
from jointz.identify.recommended.response_posterior import JointPosterior


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Predicted pulses of a participant and the posterior of joint and sensor."""

    participant: str
    cells: tuple[PredictedCell, ...]  # the timing points
    responses: tuple[CellResponse, ...]  # their average responses
    posterior: JointPosterior
    known: CalibrationSpec
    # for each timing point, which of the device's K, B and J remain in its torque
    subtract_intrinsic: tuple[tuple[str, ...], ...]
    window_s: float
    session: str = ""  # session and side of the pulses; "" if the study does not state them
    side: str = ""
