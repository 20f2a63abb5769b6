"""Result of a calibration step: all participants, and the files written."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import pandas as pd

from jointz.core.study import CalibrationSpec
from jointz.results.base import Axes, PlottedResult
from jointz.results.bench.calibration_fit import CalibrationFit

_COLUMNS = ("participant", "step", "entry", "used", "value", "sd", "unit", "status", "reason")


@dataclass(frozen=True, slots=True, repr=False)
class Calibration(PlottedResult):
    """One step of the calibration, participant by participant.

    Parameters
    ----------
    step : str
        One of :data:`~jointz.results.bench.calibration_fit.STEPS`.
    fits : mapping of str to CalibrationFit
        Participant -> fit of the step.
    study : str
        The folder that was read.
    written : tuple of str
        Files that were written.
    notes : tuple of str
        Notes about these files.
    """

    SCHEMA: ClassVar[str] = "jointz.Calibration/1"

    step: str
    fits: Mapping[str, CalibrationFit]
    study: str = ""
    written: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default_factory=tuple)

    @property
    def standing(self) -> int:
        """How many entries stand, over all participants."""
        return sum(entry.available for fit in self.fits.values() for entry in fit.entries)

    def specifications(self) -> dict[str, CalibrationSpec]:
        """Return the entries that stand, for all participants with some."""
        entries = {name: fit.specification() for name, fit in self.fits.items()}
        return {name: entry for name, entry in entries.items() if entry.model_fields_set}

    def to_frame(self) -> pd.DataFrame:
        """Return one row a participant and value; ``used``: it is an entry of a study."""
        frames = [
            fit.to_frame().assign(participant=participant) for participant, fit in self.fits.items()
        ]
        rows = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=_COLUMNS)
        return rows[list(_COLUMNS)]

    def summary(self) -> str:
        """Return a short text: everybody's values, then notes."""
        entries = sum(len(fit.entries) for fit in self.fits.values())
        head = (
            f"Step {self.step}: {self.standing} of {entries} entries stand, {len(self.fits)} people"
        )
        lines = [f"{name}: {fit.summary()}" for name, fit in self.fits.items()]
        return "\n".join([head, *lines, *(f"Note: {note}" for note in self.notes)])

    def _draw(self, axes: "Axes") -> None:
        """Draw measured and modelled samples of all participants in one figure."""
        for k, (participant, fit) in enumerate(self.fits.items()):
            shown, colour = fit.series, f"C{k % 10}"
            axes.plot(shown.x, shown.measured, ".", ms=2.0, color=colour, label=participant)
            if shown.modelled:
                axes.plot(shown.x, shown.modelled, linewidth=1.2, color=colour)
            axes.set(xlabel=shown.x_label, ylabel=shown.y_label)
        axes.set_title(f"Calibration: {self.step}; points measured, lines modelled")
        if self.fits:
            axes.legend(markerscale=4.0)
