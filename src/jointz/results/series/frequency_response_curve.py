"""A frequency response with its confidence band, and how it is drawn."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from jointz.results.base import Axes, Result

#: Okabe and Ito's palette, safe for colour-blind readers.
INK, BAND, MODEL = "#0072b2", "#7fb2d3", "#d55e00"


@dataclass(frozen=True, slots=True, repr=False)
class ResponseCurve(Result):
    """A frequency response with its confidence band."""

    frequency_hz: tuple[float, ...] = ()
    gain: tuple[float, ...] = ()  # absolute value of output over input, output unit over input unit
    phase_rad: tuple[float, ...] = ()  # phase of output over input
    gain_low: tuple[float, ...] = ()  # lower end of the pointwise interval of the gain
    gain_high: tuple[float, ...] = ()  # upper end of the pointwise interval of the gain
    phase_sd_rad: tuple[float, ...] = ()
    coherence: tuple[float, ...] = ()  # 0 to 1
    fitted_gain: tuple[float, ...] = ()  # gain of the fitted model; empty without one
    fitted_phase_rad: tuple[float, ...] = ()  # phase of the fitted model; empty without one

    def table(self) -> pd.DataFrame:
        """Return one row a frequency; the columns of a missing model are left out."""
        columns = {name: list(getattr(self, name)) for name in self.__slots__}
        return pd.DataFrame({name: values for name, values in columns.items() if values})


def draw_gain(ax: "Axes", curve: ResponseCurve, *, label: str) -> None:
    """Draw a gain with its band on logarithmic axes."""
    frequency = curve.frequency_hz
    ax.fill_between(
        frequency, curve.gain_low, curve.gain_high, color=BAND, alpha=0.5, linewidth=0.0
    )
    ax.plot(frequency, curve.gain, color=INK, label="measured")
    if curve.fitted_gain:
        ax.plot(frequency, curve.fitted_gain, color=MODEL, linestyle="--", label="second order")
    ax.set(yscale="log", ylabel=f"gain ({label})")
    if curve.gain:
        # The band runs off to nowhere where nothing is coherent; the curve must stay readable.
        shown = np.array([*curve.gain, *curve.fitted_gain])
        ax.set_ylim(0.5 * float(shown.min()), 2.0 * float(shown.max()))


def draw_phase(ax: "Axes", curve: ResponseCurve) -> None:
    """Draw a phase with two sd either side, in degrees."""
    phase, sd = np.degrees(curve.phase_rad), np.degrees(curve.phase_sd_rad)
    ax.fill_between(
        curve.frequency_hz, phase - 2 * sd, phase + 2 * sd, color=BAND, alpha=0.5, linewidth=0.0
    )
    ax.plot(curve.frequency_hz, phase, color=INK)
    if curve.fitted_phase_rad:
        fitted = np.degrees(curve.fitted_phase_rad)
        ax.plot(curve.frequency_hz, fitted, color=MODEL, linestyle="--")
    if phase.size:
        ax.set_ylim(float(phase.min()) - 20.0, float(phase.max()) + 20.0)
    ax.set_ylabel("phase (°)")
