"""Properties of a participant's joint and sensor, by the recommended estimator."""

from dataclasses import dataclass

from jointz.core.events import row_label
from jointz.results.base import Result


@dataclass(frozen=True, slots=True, repr=False)
class ParticipantModel(Result):
    """Lag, friction and probabilities of the hypotheses of one participant."""

    participant: str  # the id
    lag_s: float  # s: of the angle behind the torque: delay and first-order lag together
    lag_sd_s: float  # s
    # true over stated friction of the actuator; the prior's where torque was measured
    friction_gain: float
    friction_gain_sd: float
    # that soft tissue resonates between joint and sensor, against a mere lag
    resonance_probability: float
    # that one inertia serves all timing points, against one of each
    constant_inertia_probability: float
    # that stiffness and damping change inside the window along the curve through the points
    curve_probability: float
    n_strides: int  # unperturbed strides that the prediction was learned from; fewest of the points
    # codes of :class:`~jointz.core.codes.Doubt`: what speaks against a linear joint
    doubts: tuple[str, ...] = ()
    session: str = ""  # of the perturbed recordings; "" where the study does not state them
    side: str = ""

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)
