"""The devices and studies that the dissertation compares with, as far as its text goes.

Sections 2.4.1, 3.4, 4.1, 4.4 and appendix A. Only what the text states stands here: where
figures 4.4 and A.1 show other people's values, the text says 'larger by a factor of two or
three' or 'similar', and so does this table. The copy of the text has no bibliography: names
stand where the text names them beside a citation, and a note says so where we add the name.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

from jointz.reference import Printed

Approach = Literal["perturbation", "model"]


@dataclass(frozen=True, slots=True)
class OtherDevice:
    """What the dissertation prints about another device."""

    quantity: str  # estimated quantity, or its error
    low: float  # lower end of the printed error, in ``unit``
    high: float  # upper end of the printed error, in ``unit``; equal to ``low`` for a single number
    unit: str  # unit of ``low`` and ``high``
    citations: tuple[int, ...]  # the dissertation's own citation numbers
    source: str  # section of the dissertation
    note: str = ""  # context in the text


@dataclass(frozen=True, slots=True)
class Study:
    """A device or study that the dissertation compares with."""

    name: str  # name in the dissertation
    citations: tuple[int, ...]  # the dissertation's own citation numbers
    joint: str  # ``knee``, ``ankle`` or both, with commas
    # ``perturbation`` or ``model`` (muscle activity and inverse dynamics, no perturbation)
    approach: Approach
    conditions: str  # task and moment of the estimate, in the words of the text
    source: str  # sections of the dissertation
    errors: tuple[OtherDevice, ...] = ()  # printed errors of the device on known loads
    window: Printed | None = None  # time window of the analysis, with its unit
    vaf: Printed | None = None  # fit of the model, with its unit
    note: str = ""  # points that the text leaves open


#: 2.4.1 and 3.4: other devices, by chapter.
DEVICES_2: Final = (
    OtherDevice("stiffness error", 5.0, 5.0, "%", (2,), "2.4.1", "reported average"),
    OtherDevice("stiffness error", 15.0, 15.0, "%", (54,), "2.4.1", "for 13 of 18 trials"),
    OtherDevice("inertia error", 15.0, 15.0, "%", (54,), "2.4.1", "for 16 of 18 trials; Tucker"),
)
DEVICES_3: Final = (
    OtherDevice(
        "torque error", 0.0, 1.0, "N*m", (77,), "3.4", "MIT Anklebot, 'sub one Nm'; ours 0.33"
    ),
    OtherDevice(
        "stiffness error",
        1.68,
        15.0,
        "%",
        (34, 78, 30),
        "3.4",
        "perturbations in the sagittal plane; static or quasi-static tests",
    ),
    OtherDevice(
        "stiffness error",
        0.15,
        0.15,
        "%",
        (78,),
        "3.4",
        "the lowest found: Ficanha, frontal plane; static or quasi-static tests",
    ),
)
_ROUSE, _TUCKER_STIFFNESS, _TUCKER_INERTIA = DEVICES_2
_ANKLEBOT, _SAGITTAL, _FICANHA = DEVICES_3

STUDIES: Final[Mapping[str, Study]] = MappingProxyType(
    {
        "rouse": Study(
            "Rouse",
            (2,),
            "ankle",
            "perturbation",
            "stance phase of walking, angular perturbations by an instrumented walkway (recessed "
            "platform)",
            "1.2, 2.1, 2.4.1, 5.2",
            errors=(_ROUSE,),
            note="the text names Rouse in figure 1.2 without a number and [2] without a name: "
            "that they are one is ours",
        ),
        "tucker": Study(
            "Tucker",
            (30, 54),
            "knee",
            "perturbation",
            "20 and 30 % of the swing phase, with an exoskeleton",
            "2.4.1, 3.4, 4.1, 4.4, A",
            errors=(_TUCKER_STIFFNESS, _TUCKER_INERTIA),
            window=Printed(100.0, None, "ms", "4.4", "the same as ours"),
            vaf=Printed(72.0, None, "%", "4.4", "about; over all timing points and subjects"),
            note="[54] is the device on the bench, [30] the walking study",
        ),
        "lee": Study(
            "Lee",
            (39, 77),
            "ankle",
            "perturbation",
            "swing phase of walking, with the MIT Anklebot",
            "1.2, 2.1, 3.4",
            errors=(_ANKLEBOT,),
            note="the text names Lee and Hogan in figure 1.4 and the MIT Anklebot at [77]; that "
            "[39] is theirs is ours",
        ),
        "ficanha": Study(
            "Ficanha",
            (78,),
            "ankle",
            "perturbation",
            "static or quasi-static tests, frontal plane",
            "3.4",
            errors=(_FICANHA,),
            note="[78] is also among the sagittal devices; the joint is not stated, ankle is ours",
        ),
        "kooij": Study(
            "van der Kooij",
            (16,),
            "hip, knee",
            "perturbation",
            "initial, mid and terminal swing, with a pulling traction device",
            "1.2, 3.4, 4.1, 4.4, A",
            window=Printed(275.0, None, "ms", "4.4", "long enough for reflexes"),
            note="printed 'Kooij'",
        ),
        "pfeifer": Study(
            "Pfeifer",
            (81,),
            "knee",
            "model",
            "walking; surface EMG, ground reaction force, motion capture",
            "4.1, 4.4, A",
            note="'[81, 48]' is read in the order in which the text names the two",
        ),
        "sartori": Study(
            "Sartori",
            (48,),
            "ankle, knee",
            "model",
            "fast walking and running; musculoskeletal model, surface EMG, ground reaction force, "
            "motion capture",
            "4.1, 4.4, A",
            note="'[81, 48]' is read in the order in which the text names the two",
        ),
    }
)
