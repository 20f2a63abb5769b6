"""Gravity stiffness of a joint: masses of limb and device, posture, correction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, exp, hypot, isfinite, radians, sin, tau
from statistics import NormalDist

from jointz.core.gait_phases import PHASES
from jointz.core.study import CalibrationSpec, DeviceSpec, ParticipantSpec
from jointz.identify.preparation.cell_data import calibration_sd
from jointz.identify.preparation.sources import ParticipantSettings
from jointz.reference.body_segments import leg_beyond
from jointz.results.estimates import ParameterEstimate

#: Name of the estimate that :func:`corrected_stiffness` returns.
CORRECTED_STIFFNESS = "stiffness_gravity_corrected"
POSTURE_SD_RAD = radians(8.0)
STANCE_NOTE = (
    "stance: body weight is not in the gravity term; it acts as negative stiffness, and the "
    "term is that of a limb that hangs free"
)

_GRAVITY = 9.81  # m/s^2
_STANCE_END_PCT = PHASES["PSW"][1]
# Adults of both sexes, for an unknown height.
_AVERAGE_HEIGHT_M, _HEIGHT_SD_M = 1.70, 0.10
# Relative sd of mass times distance of the centre: by the table; by a scale and a tape.
_TABLE_SD, _MEASURED_SD = 0.10, 0.05


# Flexion of the thigh from the vertical, deg: mean, then cosine and sine of the first three
# harmonics of the gait cycle. Winter's hip angle at natural cadence (51 points), trunk upright;
# the three reproduce it to 0.3 deg RMS.
_THIGH_MEAN_DEG = 6.99
_THIGH_HARMONICS_DEG = ((15.37, -4.40), (-2.83, -1.27), (-0.30, 1.54))


@dataclass(frozen=True, slots=True)
class HangingMass:
    """A mass that turns with the distal segment of a joint."""

    mass_kg: float
    centre_m: float  # distance of its centre from the joint
    relative_sd: float  # of mass times distance
    source: str  # origin of the values

    @property
    def moment_nm(self) -> float:
        """Weight times distance, N*m: gravity stiffness of the segment when it hangs straight."""
        return self.mass_kg * _GRAVITY * self.centre_m


@dataclass(frozen=True, slots=True)
class GravityStiffness:
    """Stiffness by gravity in one posture: corrected = apparent - value."""

    value: float  # N*m/rad, positive if gravity pulls back
    sd: float  # N*m/rad
    segment_angle_rad: float  # of the distal segment from the vertical, forward positive
    source: str  # origin of masses and posture
    note: str = ""  # effects that the value does not include


def limb_gravity(
    mass_kg: float, height_m: float | None = None, *, joint: str = "knee"
) -> HangingMass | None:
    """Return mass and centre of the leg beyond a knee or hip; None for other joints.

    By de Leva's table (:mod:`jointz.reference.body_segments`), of which one person differs by
    about 10 % (1 sd) in mass times distance. It misleads for children, amputees and very heavy
    people: weigh and measure, and write ``limb_mass_kg`` and ``limb_centre_m``.
    """
    for name, value in (("mass_kg", mass_kg), ("height_m", height_m)):
        if value is not None and not (isfinite(value) and value > 0.0):
            raise ValueError(f"limb_gravity: {name}: expected a number above 0, got {value}.")
    known = _joint(joint)
    if not known:
        return None
    limb = leg_beyond(known, mass_kg, height_m or _AVERAGE_HEIGHT_M)
    source, sd = f"leg below the {known} by de Leva's table", _TABLE_SD
    if height_m is None:
        sd = hypot(sd, _HEIGHT_SD_M / _AVERAGE_HEIGHT_M)
        source += f", height not given: {_AVERAGE_HEIGHT_M:.2f} m taken"
    return HangingMass(limb.mass_kg, limb.centre_m, sd, source)


def hanging_masses(
    joint: str, person: ParticipantSpec, device: DeviceSpec | None = None
) -> tuple[HangingMass, ...]:
    """Return the masses beyond a joint: limb, as measured or else by table, and device.

    Parameters
    ----------
    joint : str
        Name of the joint.
    person : ParticipantSpec
        The participant of the study.
    device : DeviceSpec, optional
        The device on the limb.

    Returns
    -------
    tuple of HangingMass
        Empty if the limb is not known: the device alone would be half a correction.

    Notes
    -----
    Values of the study have an sd of 5 %, the accuracy of a scale and a tape on a body.
    """
    limb: HangingMass | None = None
    if person.limb_mass_kg is not None and person.limb_centre_m is not None:
        limb = HangingMass(person.limb_mass_kg, person.limb_centre_m, _MEASURED_SD, "limb as given")
    elif person.mass_kg is not None:
        limb = limb_gravity(person.mass_kg, person.height_m, joint=joint)
    if limb is None:
        return ()
    if device is None:
        return (limb,)
    return (limb, HangingMass(device.mass_kg, device.centre_m, _MEASURED_SD, "device as given"))


def thigh_angle(gait_pct: float) -> float:
    """Return the flexion of the thigh from the vertical in normal walking, rad.

    Hip angle of Winter (natural cadence, level ground, young adults) with an upright trunk, as a
    Fourier series of three harmonics. People, speeds and exoskeletons differ from it:
    ``POSTURE_SD_RAD``, 8 deg.
    """
    turn = tau * gait_pct / 100.0
    return radians(
        _THIGH_MEAN_DEG
        + sum(
            a * cos(n * turn) + b * sin(n * turn)
            for n, (a, b) in enumerate(_THIGH_HARMONICS_DEG, start=1)
        )
    )


def gravity_stiffness(
    masses: Sequence[HangingMass],
    *,
    joint: str,
    angle_rad: float,
    gait_pct: float,
    positive: str = "flexion",
    angle_sd_rad: float = 0.0,
) -> GravityStiffness | None:
    r"""Return the gravity stiffness of a joint at a moment of walking.

    Parameters
    ----------
    masses : sequence of HangingMass
        Masses beyond the joint, see :func:`hanging_masses`.
    joint : str
        ``knee`` or ``hip``, with or without a side.
    angle_rad : float
        Joint angle in the study's positive direction, zero with straight leg and trunk; best at
        the middle of the motion from which the stiffness was estimated.
    gait_pct : float
        % of the gait cycle at that moment.
    positive : str
        The study's positive direction.
    angle_sd_rad : float
        Sd of the calibrated zero of the angle, which is added to that of the posture.

    Returns
    -------
    GravityStiffness or None
        None without masses, or if the posture is not known: joints other than knee and hip,
        motion out of the sagittal plane.

    Raises
    ------
    ValueError
        If angle or phase is not finite.

    Notes
    -----
    Gravity turns a segment at the angle :math:`\alpha` from the vertical with the torque
    :math:`-m g l \sin\alpha`; its slope about a posture is :math:`m g l \cos\alpha`, negative
    when the segment is above the horizontal. For the knee :math:`\alpha` is thigh less knee
    flexion, for the hip its flexion (trunk upright, straight knee). The thigh is assumed to be
    fixed during the pulse. Errors of masses are independent of each other; that of the posture,
    8 deg, is common to all of them. It misleads in stance: see the note of the result.

    Examples
    --------
    >>> leg = limb_gravity(73.0, 1.74)
    >>> gravity = gravity_stiffness([leg], joint="knee", angle_rad=0.93, gait_pct=81.0)
    >>> round(gravity.value, 1), round(gravity.sd, 1)
    (9.1, 1.2)
    """
    if not (isfinite(angle_rad) and isfinite(gait_pct)):
        raise ValueError(
            f"gravity_stiffness: expected a finite angle and phase, got {angle_rad} and {gait_pct}."
        )
    segment = _segment_angle(_joint(joint), angle_rad, gait_pct, positive)
    if segment is None or not masses:
        return None
    moment = sum(mass.moment_nm for mass in masses)
    in_stance = gait_pct % 100.0 < _STANCE_END_PCT
    return GravityStiffness(
        value=moment * cos(segment),
        sd=_sd(
            moment,
            hypot(*(mass.relative_sd * mass.moment_nm for mass in masses)),
            segment,
            hypot(POSTURE_SD_RAD, angle_sd_rad),
        ),
        segment_angle_rad=segment,
        source="; ".join(mass.source for mass in masses) + "; posture of normal walking",
        note=STANCE_NOTE if in_stance else "",
    )


def corrected_stiffness(
    apparent: ParameterEstimate, gravity: GravityStiffness
) -> ParameterEstimate:
    """Return the stiffness without the gravity stiffness, as a separate estimate.

    The ends of the interval move out by the quantile of ``ci_level`` times ``gravity.sd``, in
    quadrature. At a bound the lower end is the bound, which moves and does not widen; the upper
    end is a one-sided limit.
    """
    if apparent.name != "stiffness":
        raise ValueError(
            f"corrected_stiffness: expected the estimate 'stiffness', got '{apparent.name}'."
        )
    value, low, high = apparent.value, apparent.ci_low, apparent.ci_high
    free = apparent.unbounded
    corrected = replace(
        apparent,
        name=CORRECTED_STIFFNESS,
        value=None if value is None else value - gravity.value,
        unbounded=None if free is None else free - gravity.value,
    )
    if value is None or low is None or high is None:
        return corrected
    one_sided = apparent.status == "at_bound"
    tail = 1.0 - apparent.ci_level if one_sided else 0.5 * (1.0 - apparent.ci_level)
    reach = NormalDist().inv_cdf(1.0 - tail) * gravity.sd
    below = value - low if one_sided else hypot(value - low, reach)
    above = hypot(high - value, reach)
    centre = value - gravity.value
    return replace(corrected, ci_low=centre - below, ci_high=centre + above)


def participant_stiffness_without_gravity(
    stiffness: ParameterEstimate,
    settings: ParticipantSettings,
    *,
    angle_rad: float,
    gait_pct: float | None,
    known: CalibrationSpec,
) -> ParameterEstimate | None:
    """Return the stiffness without gravity's part, if there is one and limb and posture are known.

    ``angle_rad`` and ``gait_pct`` are those of the middle of the motion.
    """
    if settings.person is None or gait_pct is None or stiffness.value is None:
        return None
    gravity = gravity_stiffness(
        hanging_masses(settings.joint, settings.person, settings.device),
        joint=settings.joint,
        angle_rad=angle_rad,
        gait_pct=gait_pct,
        positive=settings.positive,
        angle_sd_rad=calibration_sd(known.angle_zero_rad),
    )
    return None if gravity is None else corrected_stiffness(stiffness, gravity)


def _joint(name: str) -> str:
    """Return knee or hip if a name of the study has it, else ""."""
    words = name.lower().replace("_", " ").replace("-", " ").split()
    return next((joint for joint in ("knee", "hip") if joint in words), "")


def _segment_angle(joint: str, angle_rad: float, gait_pct: float, positive: str) -> float | None:
    """Return the angle of the distal segment from the vertical, forward positive."""
    turned = {"flexion": 1.0, "extension": -1.0}.get(positive)
    if turned is None:
        return None
    if joint == "knee":
        return thigh_angle(gait_pct) - turned * angle_rad
    return turned * angle_rad if joint == "hip" else None


def _sd(moment: float, moment_sd: float, segment: float, posture_sd: float) -> float:
    """Return the sd of moment times cosine, posture normal about ``segment``."""
    shrunk = exp(-(posture_sd**2))  # of the squared mean of the cosine
    square = 0.5 * (1.0 + shrunk**2 * cos(2.0 * segment))
    spread = square - shrunk * cos(segment) ** 2
    return float((moment**2 * spread + moment_sd**2 * square) ** 0.5)
