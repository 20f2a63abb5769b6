"""How the figures of the gallery look, whatever the script before did."""

from typing import Any


def begin(gallery_conf: dict[str, Any], file: str) -> None:  # noqa: ARG001 - sphinx-gallery's call
    """Set matplotlib to its defaults, and to ours.

    Parameters
    ----------
    gallery_conf : dict
        Settings of the gallery.
    file : str
        The script that is about to run.
    """
    import matplotlib as mpl

    mpl.rcdefaults()
    mpl.use("agg")
    mpl.rcParams.update(
        {
            "axes.spines.right": False,
            "axes.spines.top": False,
            "figure.constrained_layout.use": True,
            "figure.dpi": 110,
            "figure.figsize": (5.6, 3.4),
            "legend.frameon": False,
        }
    )


#: From a first study to one's own devices; a script that is not here comes last.
ORDER = (
    "first_study",
    "own_csv",
    "inspect_a_file",
    "convert_formats",
    "bids_and_back",
    "plan",
    "run_experiment",
    "protocols_again",
    "method_matters",
    "error_budget",
    "certificate",
    "left_out",
    "go_on_after_a_kill",
    "many_fits",
    "phase_curves",
    "time_varying",
    "impedance_profile",
    "identify_kbj",
    "identify_frf",
    "identify_irf",
    "identify_reflex",
    "people_together",
    "mixed_model",
    "spm_curves",
    "sign_flips",
    "pulse_effects",
    "quasi_stiffness",
    "compare_literature",
    "pool_labs",
    "calibrate_lag",
    "actuator_torque_model",
    "torque_bandwidth",
    "known_springs",
    "spring_three_ways",
    "safety_gate",
    "driver_contract",
)


class AsListed:
    """Sorts scripts as :data:`ORDER` has them, others by name behind them.

    Parameters
    ----------
    src_dir : str
        Where they are; not used.
    """

    def __init__(self, src_dir: str) -> None:
        self._src_dir = src_dir

    def __call__(self, filename: str) -> tuple[int, str]:
        """Return what a script is sorted by.

        Parameters
        ----------
        filename : str
            Its file.
        """
        name = filename.removesuffix(".py")
        return (ORDER.index(name) if name in ORDER else len(ORDER), name)

    def __repr__(self) -> str:
        """Return the same text in every build: Sphinx compares settings by it."""
        return "<AsListed>"
