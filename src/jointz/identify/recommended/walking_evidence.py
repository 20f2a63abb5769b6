"""What the recommended method knows of a participant after it has explained the pulses."""

from dataclasses import dataclass

from jointz.core.study import CalibrationSpec
from jointz.identify.recommended.response_model import CellResponse
from jointz.identify.recommended.response_posterior import JointPosterior
from jointz.identify.recommended.walking_responses import PredictedCell


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """The pulses of a participant, predicted and explained."""

    participant: str  # the id
    cells: tuple[PredictedCell, ...]  # the timing points
    responses: tuple[CellResponse, ...]  # their averages
    posterior: JointPosterior  # what explains them
    known: CalibrationSpec  # of the instruments
    # for each timing point, which of the device's own K, B and J are still in its torque
    subtract_intrinsic: tuple[tuple[str, ...], ...]
    window_s: float  # s: of the motion
    session: str = ""  # of the pulses; "" where the study does not state them
    side: str = ""
