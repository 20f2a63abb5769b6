"""Responses of a participant and their explanation by the recommended method."""

from dataclasses import dataclass

from jointz.core.study import CalibrationSpec
from jointz.identify.prediction.predicted_cells import PredictedCell
from jointz.identify.rigid.response_model import CellResponse
from jointz.identify.rigid.response_posterior import JointPosterior


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Predicted pulses of a participant and the posterior of joint and sensor."""

    participant: str
    cells: tuple[PredictedCell, ...]  # one for each timing point
    responses: tuple[CellResponse, ...]  # average response of each cell
    posterior: JointPosterior
    known: CalibrationSpec
    # for each timing point, those of the device's K, B and J that its torque still includes
    subtract_intrinsic: tuple[tuple[str, ...], ...]
    session: str = ""  # session of the pulses; "" if the study does not state it
    side: str = ""  # side of the pulses; "" if the study does not state it
