"""What the recommended method knows of a participant after it has explained the pulses."""

from dataclasses import dataclass

from jointz.core.study import CalibrationSpec
from jointz.identify.recommended.response_model import CellResponse
from jointz.identify.recommended.response_posterior import JointPosterior
from jointz.identify.recommended.walking_responses import PredictedCell


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """The pulses of a participant, predicted and explained.

    Parameters
    ----------
    participant : str
        The id.
    cells : tuple of PredictedCell
        The timing points.
    responses : tuple of CellResponse
        Their averages.
    posterior : JointPosterior
        What explains them.
    known : CalibrationSpec
        Of the instruments.
    subtract_intrinsic : tuple of tuple of str
        For each timing point, which of the device's own K, B and J are still in its torque.
    window_s : float, s
        Of the motion.
    session, side : str
        Of the pulses; "" where the study does not state them.
    """

    participant: str
    cells: tuple[PredictedCell, ...]
    responses: tuple[CellResponse, ...]
    posterior: JointPosterior
    known: CalibrationSpec
    subtract_intrinsic: tuple[tuple[str, ...], ...]
    window_s: float
    session: str = ""
    side: str = ""
