"""The torque model of an actuator: equations 3.1 to 3.3, fitted to a bench record."""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from jointz.results.base import Axes, summary_text
from jointz.results.fit import Fit, parameter_line

_EQUATIONS = {"current": "3.1", "motor": "3.2", "friction": "3.3"}
_REGIME_COLOURS = ("#2c5c8f", "#5b9bc4", "#a9c9dd", "#f0b88a", "#d9763f", "#9c3a1c")
_INK = "0.25"
_DOTS: dict[str, Any] = {"linestyle": "", "marker": ".", "markersize": 3.0}
#: Shares of the record that end the speed regimes of the figure.
_REGIME_SHARES = (1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6)


@dataclass(frozen=True, slots=True)
class ActuatorSeries:
    """Samples of a record, thinned to what a figure can show."""

    position: tuple[float, ...] = ()  # time, s; sample numbers if the record has no rate
    measured: tuple[float, ...] = ()  # torque by the sensor, N*m
    modelled: tuple[float, ...] = ()  # torque of the model, bias included, N*m
    velocity: tuple[float, ...] = ()  # velocity of the output, rad/s; empty where none was given
    in_seconds: bool = True  # whether ``position`` is a time


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class ActuatorFit(Fit):
    """A torque model (3.1 to 3.3) with what the record could not decide.

    Parameters
    ----------
    model : str
        ``current`` (3.1), ``motor`` (3.2) or ``friction`` (3.3).
    parameters : tuple of ParameterEstimate
        Every parameter of the model: ``bias``, ``torque_constant`` (motor side)
        and, by model, ``viscous_friction``, ``coulomb_friction``,
        ``gear_friction``, ``rotor_inertia`` (at the output). One that the record
        does not support is None, with status ``undecided``; the reason is among
        the warnings. A record too short for intervals leaves ``undecided`` values
        without one.
    rms_error_nm : float
        RMS of measured minus modelled torque, N*m.
    vaf_pct : float
        Variance of the torque that the model accounts for (2.7), offset removed, %.
    status : str
        ``undecided`` where a parameter is that the given columns were to decide,
        else ``ok``. A rotor inertia without any acceleration does not count.
    gear_ratio : float
        Motor turns a turn of the output.
    torque_sign : float
        1, or -1 where the sensor's torque was turned.
    n_samples : int
        Samples used.
    rate_hz : float or None
        Sampling rate, where it was given.
    condition_number : float
        Of the scaled regressors.
    covariance : tuple of tuple of float
        Of the fitted parameters in their order; empty where there is none.
    fitted : tuple of str
        The fitted parameters.
    ci_method : str
        How covariance and intervals were made.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the numbers must know.
    series : ActuatorSeries
        For the figure.
    """

    SCHEMA: ClassVar[str] = "jointz.ActuatorFit/1"
    COLUMNS: ClassVar[tuple[str, ...]] = ("rms_error_nm", "n_samples", "model")
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (8.0, 5.0)

    model: str
    rms_error_nm: float
    status: str
    gear_ratio: float
    torque_sign: float
    n_samples: int
    rate_hz: float | None
    condition_number: float
    covariance: tuple[tuple[float, ...], ...]
    fitted: tuple[str, ...]
    ci_method: str
    series: ActuatorSeries = field(default_factory=ActuatorSeries)

    def summary(self) -> str:
        """Return a short text: parameters, intervals, error, warnings."""
        length = f"{self.n_samples} samples"
        if self.rate_hz is not None:
            length += f" at {self.rate_hz:.6g} Hz"
        lines = [
            f"{length}, gear ratio {self.gear_ratio:g}",
            *(parameter_line(p, width=16) for p in self.parameters),
            f"RMS error {self.rms_error_nm:.3g} N*m, VAF {self.vaf_pct:.2f} %; "
            f"intervals: {self.ci_method}",
        ]
        title = f"Torque model {self.model} ({_EQUATIONS[self.model]}): {self.status}"
        return summary_text(title, lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw measured and modelled torque by regime of speed, the residual below."""
        axes.axis("off")
        axes.set_ylabel("torque")
        upper = axes.inset_axes((0.0, 0.36, 1.0, 0.64))
        lower = axes.inset_axes((0.0, 0.0, 1.0, 0.3))
        series = self.series
        position, measured = np.array(series.position), np.array(series.measured)
        modelled = np.array(series.modelled)
        upper.plot(position, measured, color=_INK, linewidth=0.9, label="measured", zorder=1)
        for name, colour, inside in _regimes(np.array(series.velocity), position.size):
            dots = _DOTS | {"color": colour}
            upper.plot(position[inside], modelled[inside], label=name, **dots)
            lower.plot(position[inside], (measured - modelled)[inside], **dots)
        lower.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        upper.set_ylabel("torque (N·m)")
        lower.set(ylabel="residual (N·m)", xlabel="time (s)" if series.in_seconds else "sample")
        upper.sharex(lower)
        upper.tick_params(labelbottom=False)
        upper.set_title(self._title(), fontsize="medium")
        title = "model, speed in rad/s" if series.velocity else None
        upper.legend(
            title=title, fontsize="x-small", title_fontsize="x-small", ncols=4, markerscale=2.5
        )
        low, high = upper.get_ylim()
        upper.set_ylim(low, high + 0.3 * (high - low))

    def _title(self) -> str:
        constant = self.parameter("torque_constant")
        value = constant.status if constant.value is None else f"{constant.value:.3g} N*m/A"
        return (
            f"model {self.model} ({_EQUATIONS[self.model]}): "
            f"RMS error {self.rms_error_nm:.2g} N*m, torque constant {value}"
        )


def _regimes(velocity: np.ndarray, n: int) -> list[tuple[str, str, np.ndarray]]:
    """Return name, colour and samples of each regime of speed, equally many in each."""
    if not velocity.size:
        return [("model", _REGIME_COLOURS[0], np.ones(n, dtype=bool))]
    edges = np.unique(np.quantile(velocity, _REGIME_SHARES).round(1) + 0.0)
    regime = np.searchsorted(edges, velocity)
    bounds = [f"{edge:g}" for edge in edges]
    names = [
        f"below {bounds[0]}",
        *(f"{a} to {b}" for a, b in pairwise(bounds)),
        f"above {bounds[-1]}",
    ]
    step = (len(_REGIME_COLOURS) - 1) / (len(names) - 1)
    colours = [_REGIME_COLOURS[round(k * step)] for k in range(len(names))]
    return [
        (name, colour, regime == k)
        for k, (name, colour) in enumerate(zip(names, colours, strict=True))
        if np.any(regime == k)
    ]
