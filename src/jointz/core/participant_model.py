"""What the recommended estimator found out about a participant's joint and sensor."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from jointz.core.person_estimates import row_label


@dataclass(frozen=True, slots=True)
class ParticipantModel:
    """Which hypotheses the responses of a participant speak for.

    Parameters
    ----------
    participant : str
        The id.
    lag_s, lag_sd_s : float, s
        Of the angle behind the torque: delay and first-order lag together.
    friction_gain, friction_gain_sd : float
        True over stated friction of the actuator; the prior's where torque was measured.
    resonance_probability : float
        That soft tissue resonates between joint and sensor, against a mere lag.
    constant_inertia_probability : float
        That one inertia serves all timing points, against one of each.
    curve_probability : float
        That stiffness and damping change inside the window along the curve through the points.
    n_strides : int
        Unperturbed strides that the prediction was learned from; fewest of the points.
    doubts : tuple of str
        Codes of :class:`~jointz.core.codes.Doubt`: what speaks against a linear joint.
    session, side : str
        Of the perturbed recordings; "" where the study does not state them.
    """

    participant: str
    lag_s: float
    lag_sd_s: float
    friction_gain: float
    friction_gain_sd: float
    resonance_probability: float
    constant_inertia_probability: float
    curve_probability: float
    n_strides: int
    doubts: tuple[str, ...] = ()
    session: str = ""
    side: str = ""

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "ParticipantModel":
        """Rebuild from :meth:`to_dict`.

        Parameters
        ----------
        data : mapping
            What it returned.
        """
        return cls(**{**data, "doubts": tuple(data.get("doubts", ()))})
