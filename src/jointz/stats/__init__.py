"""Statistics of estimates; each name is loaded when it is first used."""

from importlib import import_module

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from jointz.stats.mixed_models import mixed_model
    from jointz.stats.quasi_stiffness_slopes import compare_quasi_stiffness, quasi_stiffness
    from jointz.stats.sign_flip import sign_flip_max_t
    from jointz.stats.spm import spm_paired_t, spm_unpaired_t

_HOMES = {
    "compare_quasi_stiffness": "jointz.stats.quasi_stiffness_slopes",
    "mixed_model": "jointz.stats.mixed_models",
    "quasi_stiffness": "jointz.stats.quasi_stiffness_slopes",
    "sign_flip_max_t": "jointz.stats.sign_flip",
    "spm_paired_t": "jointz.stats.spm",
    "spm_unpaired_t": "jointz.stats.spm",
}

__all__ = [
    "compare_quasi_stiffness",
    "mixed_model",
    "quasi_stiffness",
    "sign_flip_max_t",
    "spm_paired_t",
    "spm_unpaired_t",
]


def __getattr__(name: str) -> "Any":
    """Load a public name from its home on first use."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'jointz.stats' has no attribute {name!r}")


def __dir__() -> list[str]:
    """List the public names."""
    return sorted(__all__)
