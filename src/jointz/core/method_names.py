"""Names of methods and baselines that other parts of jointz refer to."""

from typing import Final

RECOMMENDED: Final = "recommended"
STRAPPED: Final = "strapped"
DISSERTATION: Final = "dissertation"
MATCHED_STRIDES: Final = "matched_strides"
FULL_RECORD: Final = "full_record"
#: Method of single pulses on a bench.
PULSE_LIKELIHOOD: Final = "pulse_likelihood"

#: Baseline of the methods that predict the unperturbed motion.
PREDICTED: Final = "predicted"
