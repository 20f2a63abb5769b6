"""Statistics of estimates."""

# Not lazy: a module that shares the name of its function would take its place when loaded.
from jointz.stats.mixed_model import mixed_model
from jointz.stats.quasi_stiffness import compare_quasi_stiffness, quasi_stiffness
from jointz.stats.sign_flip import sign_flip_max_t
from jointz.stats.spm import spm_paired_t, spm_unpaired_t

__all__ = [
    "compare_quasi_stiffness",
    "mixed_model",
    "quasi_stiffness",
    "sign_flip_max_t",
    "spm_paired_t",
    "spm_unpaired_t",
]
