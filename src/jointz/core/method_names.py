"""Names of methods and baselines that other parts of jointz refer to."""

from typing import Final

#: Asked for, it stands for the right method of the study; no estimate carries it.
RECOMMENDED: Final = "recommended"
#: Walking with a device that is strapped to the leg, or coupled to the bone without play.
STRAPPED: Final = "strapped"
RIGID: Final = "rigid"
#: A device that moves with the bone, by the estimator of ``strapped``: not offered yet.
RIGID_COUPLING: Final = "rigid_coupling"
DISSERTATION: Final = "dissertation"
MATCHED_STRIDES: Final = "matched_strides"
FULL_RECORD: Final = "full_record"
#: Method of single pulses on a bench.
PULSE_LIKELIHOOD: Final = "pulse_likelihood"

#: Names in results that were written before -> present ones.
FORMER_NAMES: Final = {"recommended": RIGID}

#: Baseline of the methods that predict the unperturbed motion.
PREDICTED: Final = "predicted"
