"""Properties of a participant's joint and sensor, by the method ``rigid``."""

from dataclasses import dataclass

from jointz.core.events import row_label
from jointz.results.base import Result


@dataclass(frozen=True, slots=True, repr=False)
class ParticipantModel(Result):
    """Lag, friction and probabilities of the hypotheses of one participant."""

    participant: str  # the id
    lag_s: float  # s: total lag of the angle behind the torque, delay included
    lag_sd_s: float  # s: sd of ``lag_s``
    # true over stated friction of the actuator; the prior mean where torque was measured
    friction_gain: float
    friction_gain_sd: float
    # probability that soft tissue resonates between joint and sensor, rather than only lags
    resonance_probability: float
    # probability of one inertia for all timing points, rather than one for each
    constant_inertia_probability: float
    # probability that stiffness and damping change inside the window along the curve through the
    # timing points
    curve_probability: float
    # unperturbed strides behind the prediction; smallest number over the timing points
    n_strides: int
    # evidence against a linear joint, codes of :class:`~jointz.core.codes.Doubt`
    doubts: tuple[str, ...] = ()
    session: str = ""  # session of the perturbed recordings; "" where the study does not state it
    side: str = ""  # side of the perturbed recordings; "" where the study does not state it

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)
