"""The analysis of a whole study, with everything needed to reproduce it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.core.channels import PARAMETER_NAMES, axis_label
from jointz.core.errors import DataError
from jointz.core.events import GapRecord, PulseEstimate, PulseRecord, StrideRecord, row_label
from jointz.results.base import Axes, Result, record_frame, summary_text
from jointz.results.certificate_result import Certificate
from jointz.results.estimates import ESTIMATE_COLUMNS, CellEstimate
from jointz.results.figure_style import BLUE, FAINT, axes_or_new, in_figure_style
from jointz.results.log_posterior import LOG_POSTERIOR_COLUMNS, LogPosterior
from jointz.results.mean_stride import MeanStride
from jointz.results.run_report import RunReport
from jointz.results.study_counts import study_counts


@dataclass(frozen=True, slots=True, repr=False)
class ParticipantModel(Result):
    """Lag, friction and probabilities of the hypotheses of one participant."""

    participant: str  # the id
    lag_s: float  # s: total lag of the angle behind the torque, delay included
    lag_sd_s: float  # s: sd of ``lag_s``
    # true over stated friction of the actuator; the prior mean where torque was measured
    friction_gain: float
    friction_gain_sd: float
    # probability that soft tissue resonates between joint and sensor, rather than only lags
    resonance_probability: float
    # probability of one inertia for all timing points, rather than one for each
    constant_inertia_probability: float
    # probability that stiffness and damping change inside the window along the curve through the
    # timing points
    curve_probability: float
    # unperturbed strides behind the prediction; smallest number over the timing points
    n_strides: int
    # evidence against a linear joint, codes of :class:`~jointz.core.codes.Doubt`
    doubts: tuple[str, ...] = ()
    session: str = ""  # session of the perturbed recordings; "" where the study does not state it
    side: str = ""  # side of the perturbed recordings; "" where the study does not state it

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)


#: Marks that tell people apart in grey, too.
_MARKS = "osD^vPX*"
#: Said where a bench has more than one "participant".
NO_MEANS_ON_A_BENCH = (
    "Means over participants are left out: those of a bench study are loads, and a mean over "
    "unlike loads means nothing."
)
#: Columns of ``excluded.csv``.
EXCLUDED_COLUMNS = (
    "participant",
    "recording",
    "onset_s",
    "timing_point",
    "kind",
    "code",
    "detail",
    "session",
    "side",
)


@dataclass(frozen=True, slots=True)
class PopulationEstimate:
    """Mean of one parameter over people, with an interval over people."""

    timing_point: str
    onset_gait_pct: float | None  # mean measured onset, % of the gait cycle
    parameter: str
    value: float | None  # mean over people, in ``unit``
    unit: str
    # standard deviation between people, in ``unit``; of people together that of the model, which
    # has one relative SD for all timing points
    sd: float | None
    ci_low: float | None  # lower end of Student's interval, in ``unit``
    ci_high: float | None  # upper end of Student's interval, in ``unit``
    n_participants: int  # people with a value
    method: str  # as in :class:`CellEstimate`
    # as in :class:`jointz.results.estimates.ParameterEstimate`; ``undecided`` or failed without a
    # value
    status: str
    ci_level: float = 0.95  # level of the interval
    # standard deviation of the people's available estimates, in ``unit``, with their errors
    sample_sd: float | None = None


@dataclass(frozen=True, slots=True, repr=False)
class StudyAnalysis(Result):
    """Result of analysing a study.

    Parameters
    ----------
    cells : tuple of CellEstimate
        The chosen method.
    comparison : tuple of CellEstimate
        Other methods on the same recordings.
    population : tuple of PopulationEstimate
        Means over people; none in a bench study.
    pulses, strides, gaps : tuple
        Everything found in the recordings, used or not.
    single : tuple of PulseEstimate
        Pulses of a bench, each estimated by itself.
    models : tuple of ParticipantModel
        What the method ``rigid`` found about each walker's joint and sensor.
    log_posteriors : tuple of LogPosterior
        Joint posterior of each walker's impedance at all timing points; of methods that provide
        it.
    mean_strides : tuple of MeanStride
        Mean stride of each walker in each condition, over the strides without pulses.
    certificate : Certificate or None
        What error to expect in this study, if it was asked for.
    statistics : mapping
        Descriptive statistics: onset accuracy, strides, VAF.
    settings : mapping
        Method, resamples, seed, window and filter.
    provenance : mapping
        Versions, hashes, history of every input.
    """

    SCHEMA: ClassVar[str] = "jointz.StudyAnalysis/1"

    cells: tuple[CellEstimate, ...]
    comparison: tuple[CellEstimate, ...] = ()
    population: tuple[PopulationEstimate, ...] = ()
    pulses: tuple[PulseRecord, ...] = ()
    strides: tuple[StrideRecord, ...] = ()
    gaps: tuple[GapRecord, ...] = ()
    single: tuple[PulseEstimate, ...] = ()
    models: tuple[ParticipantModel, ...] = ()
    log_posteriors: tuple[LogPosterior, ...] = ()
    mean_strides: tuple[MeanStride, ...] = ()
    certificate: Certificate | None = None
    statistics: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def n_standing(self) -> int:
        """Number of available estimates."""
        return sum(p.available for cell in self.cells for p in cell.parameters)

    @property
    def coupling(self) -> str:
        """Assumed coupling of device and leg; results that were written before are of a strap."""
        return str(self.settings.get("coupling") or "strap")

    @property
    def simulated(self) -> bool:
        """True if the study is known to be simulated."""
        return bool(self.provenance.get("run", {}).get("simulated"))

    @property
    def run(self) -> RunReport | None:
        """The report of ``jointz run``; None for studies without."""
        report = self.provenance.get("run", {}).get("report")
        return RunReport.from_dict(report) if report else None

    @property
    def changes_text(self) -> str:
        """How the pulses of the run differ from its plan, "" where they do not."""
        return self.run.changes_text if self.run else ""

    def to_frame(self) -> pd.DataFrame:
        """Return the estimates as a tidy table, one row an estimate."""
        return _frame(self.cells)

    def comparison_frame(self) -> pd.DataFrame:
        """Return the other methods' estimates in the same columns."""
        return _frame(self.comparison)

    def population_frame(self) -> pd.DataFrame:
        """Return the means over people."""
        return record_frame(self.population, PopulationEstimate.__slots__)

    def strides_frame(self) -> pd.DataFrame:
        """Return every stride found, accepted or not."""
        return record_frame(self.strides, StrideRecord.__slots__)

    def pulses_frame(self) -> pd.DataFrame:
        """Return every pulse found, used or not."""
        return record_frame(self.pulses, PulseRecord.__slots__)

    def single_frame(self) -> pd.DataFrame:
        """Return the pulses of a bench, each estimated by itself."""
        return record_frame(self.single, PulseEstimate.__slots__)

    def log_posterior_frame(self) -> pd.DataFrame:
        """Return the posteriors of all people, if the method provides them."""
        rows = [row for posterior in self.log_posteriors for row in posterior.rows()]
        return pd.DataFrame(rows, columns=list(LOG_POSTERIOR_COLUMNS))

    def excluded_frame(self) -> pd.DataFrame:
        """Return every stride and pulse left out, with its code."""
        rows = [_excluded(p, "pulse", p.onset_s, p.timing_point) for p in self.pulses if p.code]
        rows += [_excluded(s, "stride", s.start_s, "") for s in self.strides if s.code]
        return pd.DataFrame(rows, columns=list(EXCLUDED_COLUMNS))

    def summary(self) -> str:
        """Return a short text: counts of people, cells and pulses, and the means."""
        counts = study_counts(self)
        title = (
            f"{counts.people} {'simulated ' * self.simulated}participant(s), method "
            f"{self.settings.get('method', '?')}: {counts.available} of "
            f"{counts.statuses.total()} estimates of K, B and J available; "
            f"pulses: {counts.pulses_text}."
        )
        lines = (
            f"{p.timing_point:>12} {p.parameter:<20} "
            f"{p.status if p.value is None else f'{p.value:9.4g} {p.unit}'} "
            f"(mean of {p.n_participants})"
            for p in self.population
            if p.n_participants > 1
        )
        return summary_text(title, lines)

    @in_figure_style
    def plot(self, ax: "Axes | None" = None, *, parameter: str = "stiffness") -> "Axes":
        """Draw one parameter with its intervals, over the gait cycle or the groups of a bench.

        On axes that are given, without title and legend (``ax.legend()`` adds one). Raises
        DataError if no estimate has this parameter.
        """
        known = list(dict.fromkeys(p.name for cell in self.cells for p in cell.parameters))
        if parameter not in (known or PARAMETER_NAMES):
            raise DataError(
                f"plot: parameter: expected one of {', '.join(known or PARAMETER_NAMES)}; got "
                f"{parameter!r}."
            )
        axes = axes_or_new(ax, (8.0, 4.0))
        table = self.to_frame().query("parameter == @parameter")
        # One axis for all: a cell that failed has no onset, and is left out of the cycle.
        walking = table["onset_gait_pct"].notna().any()
        places = {name: at for at, name in enumerate(dict.fromkeys(table["timing_point"]))}
        at = table["onset_gait_pct"] if walking else table["timing_point"].map(places)
        people = list(table.groupby(["participant", "session", "side"], sort=False))
        means = [m for m in self.population if m.parameter == parameter and m.value is not None]
        # Where there are means, people are the background.
        background = {"color": FAINT, "linewidth": 0.6, "markersize": 2.5}
        look: dict[str, Any] = background if means else {}
        for number, (key, rows) in enumerate(people):
            # Groups have one place; intervals stand beside each other. Onsets differ by themselves.
            beside = 0.0 if walking else (number - (len(people) - 1) / 2) * 0.05
            mark = _MARKS[number % len(_MARKS)]
            (line,) = axes.plot(
                at[rows.index] + beside,
                rows["value"],
                marker=mark,
                linestyle="-" if walking else "",
                label="" if means else row_label(*map(str, key)),
                **look,
            )
            axes.vlines(
                at[rows.index] + beside,
                rows["ci_low"],
                rows["ci_high"],
                line.get_color(),
                linewidth=line.get_linewidth(),
            )
        self._draw_means(axes, means, places, walking=bool(walking))
        axes.set_xlabel("gait cycle (%)" if walking else "")
        if not walking:
            axes.set_xticks(list(places.values()), list(places))
        axes.set_ylabel(axis_label(parameter))
        if ax is None:
            axes.set_title(f"Vertical lines: {self.settings.get('ci_level', 0.95):.0%} intervals")
        if people and ax is None:
            axes.legend(ncols=-(-len(people) // 8) if not means else 1)
        return axes

    def _draw_means(
        self,
        axes: "Axes",
        means: Sequence[PopulationEstimate],
        places: Mapping[str, int],
        *,
        walking: bool,
    ) -> None:
        onsets = {m.timing_point: m.onset_gait_pct for m in means if m.onset_gait_pct is not None}
        at_points: Mapping[str, float] = onsets if walking else places
        drawn = [m for m in means if m.timing_point in at_points]
        if not drawn:
            return
        ends = np.array([(m.ci_low, m.value, m.ci_high) for m in drawn], dtype=float)
        at = [at_points[m.timing_point] for m in drawn]
        numbers = sorted({m.n_participants for m in drawn})
        span = " to ".join(str(n) for n in dict.fromkeys((numbers[0], numbers[-1])))
        label = f"mean over {span} participants"
        axes.plot(at, ends[:, 1], "o", color=BLUE, markersize=5.0, zorder=3, label=label)
        axes.vlines(at, ends[:, 0], ends[:, 2], BLUE, linewidth=2.0, zorder=3)
        axes.plot([], [], marker="o", color=FAINT, markersize=2.5, label="each participant")


def _excluded(
    record: PulseRecord | StrideRecord, kind: str, onset_s: float, timing_point: str
) -> tuple[str | float, ...]:
    where = (record.participant, record.recording, onset_s, timing_point, kind)
    return (*where, record.code, record.detail, record.session, record.side)


def _frame(cells: tuple[CellEstimate, ...]) -> pd.DataFrame:
    rows = [row for cell in cells for row in cell.rows()]
    return pd.DataFrame(rows, columns=list(ESTIMATE_COLUMNS))
