"""The bandwidth of a closed torque loop, with what the spectra can resolve."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import pandas as pd

from jointz.results.base import Axes, PlottedResult, summary_text
from jointz.results.series.frequency_response_curve import INK, MODEL, ResponseCurve, draw_gain

#: Fields that the table has beside the bandwidth and its interval.
_COLUMNS = "ci_level", "status", "resolution_hz", "coherence", "reference_gain", "drop_db", "method"


@dataclass(frozen=True, slots=True, repr=False)
class BandwidthFit(PlottedResult):
    """Frequency at which a torque loop has lost ``drop_db`` of its gain.

    Parameters
    ----------
    bandwidth_hz : float
        The frequency.
    ci_low_hz, ci_high_hz : float
        Its interval, of noise alone.
    ci_level : float
        Level of the interval.
    drop_db : float
        Loss of gain, dB.
    reference_gain : float
        Gain at low frequency from which the loss counts, N*m of torque a N*m
        of command.
    reference_hz : tuple of float
        Band of the frequencies behind ``reference_gain``.
    resolution_hz : float
        Details closer than this are run together; the bandwidth is above it.
    coherence : float
        Of command and torque at the bandwidth.
    response : ResponseCurve
        Torque over command.
    method : str
        ``welch`` or ``blackman_tukey``.
    window_s : float
        Length of a Welch segment, or longest lag of Blackman and Tukey.
    n_averages : float
        Independent averages at each frequency.
    n_samples : int
        Samples of the record.
    rate_hz : float
        Sampling rate.
    ci_method : str
        How the interval was made.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the number must know.
    """

    SCHEMA: ClassVar[str] = "jointz.BandwidthFit/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 4.0)

    bandwidth_hz: float
    ci_low_hz: float
    ci_high_hz: float
    ci_level: float
    drop_db: float
    reference_gain: float
    reference_hz: tuple[float, float]
    resolution_hz: float
    coherence: float
    response: ResponseCurve
    method: str
    window_s: float
    n_averages: float
    n_samples: int
    rate_hz: float
    ci_method: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def status(self) -> str:
        """Always ``ok``: a bandwidth that the data do not determine raises an error."""
        return "ok"

    def to_frame(self) -> pd.DataFrame:
        """Return one row; the curve is ``response.table()``."""
        row = {
            "parameter": "bandwidth",
            "value": self.bandwidth_hz,
            "unit": "Hz",
            "ci_low": self.ci_low_hz,
            "ci_high": self.ci_high_hz,
        }
        return pd.DataFrame([row | {name: getattr(self, name) for name in _COLUMNS}])

    def summary(self) -> str:
        """Return a short text: the bandwidth, its interval, the resolution, warnings."""
        seconds = self.n_samples / self.rate_hz
        title = (
            f"Torque bandwidth, -{self.drop_db:g} dB: {self.bandwidth_hz:.4g} Hz "
            f"({self.ci_level:.0%} interval {self.ci_low_hz:.4g} to {self.ci_high_hz:.4g})"
        )
        lines = [
            f"resolution {self.resolution_hz:.3g} Hz ({self.method}, window {self.window_s:.3g} "
            f"s, {self.n_averages:.0f} averages); {seconds:.1f} s at {self.rate_hz:.6g} Hz",
            f"coherence {self.coherence:.3f} there; gain {self.reference_gain:.4g} at "
            f"{self.reference_hz[0]:.3g} to {self.reference_hz[1]:.3g} Hz",
            f"interval: {self.ci_method}",
        ]
        return summary_text(title, lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw the gain with its band, the loss, the bandwidth and the resolution."""
        draw_gain(axes, self.response, label="N·m/N·m")
        level = self.reference_gain * 10.0 ** (-self.drop_db / 20.0)
        axes.axhline(self.reference_gain, color="0.6", linewidth=0.8)
        axes.axhline(
            level, color=MODEL, linestyle=":", linewidth=1.0, label=f"-{self.drop_db:g} dB"
        )
        axes.axvspan(self.ci_low_hz, self.ci_high_hz, color=MODEL, alpha=0.15, linewidth=0.0)
        axes.plot([self.bandwidth_hz], [level], "o", color=MODEL)
        start_hz = self.bandwidth_hz - self.resolution_hz / 2
        axes.plot(
            [start_hz, start_hz + self.resolution_hz],
            [0.8 * level, 0.8 * level],
            color=INK,
            linewidth=3.0,
            label=f"resolution {self.resolution_hz:.2g} Hz",
        )
        axes.set(xscale="log", xlabel="frequency (Hz)")
        axes.set_title(
            f"bandwidth {self.bandwidth_hz:.3g} Hz ({self.ci_low_hz:.3g} to "
            f"{self.ci_high_hz:.3g}), coherence {self.coherence:.3f}",
            fontsize="medium",
        )
        axes.legend(loc="lower left")
