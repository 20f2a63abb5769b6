"""Report of a run: pulses done, their onsets in the gait cycle, timing of the loop."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.results.base import Axes, PlottedResult, Result

_COLUMNS = (
    "participant",
    "condition",
    "timing_point",
    "planned_pct",
    "planned",
    "completed",
    "missed",
    "aborted",
    "lost",
    "withdrawn",
    "n",
    "n_missing",
    "error_mean_pct",
    "error_sd_pct",
    "theory_sd_pct",
)
_COUNTS = _COLUMNS[4:-3]


@dataclass(frozen=True, slots=True, repr=False)
class RunReport(PlottedResult):
    """Report of a run, one row a participant, condition and timing point."""

    SCHEMA: ClassVar[str] = "jointz.RunReport/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (6.4, 4.8)

    protocol: str  # name of the protocol
    seed: int  # seed of plan and simulation
    # ``participant, condition, timing_point, planned_pct, planned, completed, missed, aborted,
    # lost`` (completed, but the log lost them), ``withdrawn`` (not tried again; not in older
    # reports) and the error of the onsets, broken-off pulses included, as the time since the heel
    # strike over the duration of the same stride: ``n, n_missing`` (outside accepted strides),
    # ``error_mean_pct, error_sd_pct`` and ``theory_sd_pct``, the SD that the variation of the
    # strides alone makes; all in % of the gait cycle
    onsets: tuple[Mapping[str, Any], ...]
    # ``participant, condition, fewest, most, planned_fewest, planned_most``: strides between pulses
    gaps: tuple[Mapping[str, Any], ...]
    # ``participant, condition, segment`` and timing statistics of the control loop
    timing: tuple[Mapping[str, Any], ...]
    salvaged: tuple[str, ...] = ()  # sentences about damaged files and the data lost with them
    # ``participant, condition, decisions, steered`` (decisions that moved pulses to other timing
    # points), ``without_estimate, stopped, planned, completed``: sessions with live estimates
    decisions: tuple[Mapping[str, Any], ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """Return the onsets as a table, one row a participant, condition and timing point."""
        return pd.DataFrame([dict(row) for row in self.onsets], columns=list(_COLUMNS))

    def onset_rows(self) -> list[dict[str, Any]]:
        """Return the onsets as plain values, None where there is no number."""
        return [
            {k: None if isinstance(v, float) and isnan(v) else v for k, v in row.items()}
            for row in self.onsets
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON, which has no NaN."""
        return Result.to_dict(self) | {"onsets": self.onset_rows()}

    @property
    def n_planned(self) -> int:
        """Number of planned pulses."""
        return int(self.to_frame()["planned"].sum())

    @property
    def withdrawn_text(self) -> str:
        """How many pulses were withdrawn and why, "" for none."""
        n = int(self.to_frame()["withdrawn"].sum())
        if not n:
            return ""
        return (
            f"{n} {'pulse was' if n == 1 else 'pulses were'} withdrawn, because pulses at the same "
            "timing point moved a knee beyond safety.displacement_rad three times in a row."
        )

    @property
    def decided_text(self) -> str:
        """Sentences about the decisions of live estimates, "" without any."""
        steered = [row for row in self.decisions if row["steered"]]
        stopped = [row for row in self.decisions if row["stopped"]]
        texts = []
        if steered:
            texts.append(
                f"Live estimates moved pulses to timing points with wide intervals in "
                f"{len(steered)} of {len(self.decisions)} sessions "
                f"({sum(row['steered'] for row in steered)} decisions)."
            )
        if stopped:
            done = sorted({row["completed"] for row in stopped})
            after = f"{done[0]}" if len(done) == 1 else f"{done[0]} to {done[-1]}"
            texts.append(
                f"{len(stopped)} of {len(self.decisions)} sessions ended before the plan, after "
                f"{after} of {max(row['planned'] for row in stopped)} pulses: live estimates had "
                "reached every planned half-width."
            )
        if without := sum(row["without_estimate"] for row in self.decisions):
            total = sum(row["decisions"] for row in self.decisions)
            texts.append(
                f"For {without} of {total} decisions there was no estimate: pulses came as planned."
            )
        return " ".join(texts)

    @property
    def changes_text(self) -> str:
        """How the pulses differ from the plan, "" where they do not."""
        return " ".join(filter(None, (self.withdrawn_text, self.decided_text)))

    def summary(self) -> str:
        """Return a few lines of text."""
        table = self.to_frame()
        count = len({row["participant"] for row in self.timing})
        lines = [f"{self.protocol}, seed {self.seed}: {count} session{'s' if count != 1 else ''}"]
        if table.empty:
            return "\n".join([*lines, *self.salvaged])
        repeated = {name: int(table[name].sum()) for name in ("missed", "aborted", "lost")}
        repeated_text = ", ".join(f"{count} {name}" for name, count in repeated.items() if count)
        done = f"{table['completed'].sum()} of {table['planned'].sum()} pulses"
        lines.append(f"{done}; done again: {repeated_text}" if repeated_text else done)
        if self.changes_text:
            lines.append(self.changes_text)
        for name, row in self.pooled_onsets().to_dict("index").items():
            lines.append(f"{name}: {_onset_sentence(row)}")
        return "\n".join([*lines, *self.salvaged])

    def pooled_onsets(self) -> pd.DataFrame:
        """Return mean and SD of the onset error over the pulses of all participants."""
        table = self.to_frame()
        table = table[table["planned_pct"].notna()]  # on a bench nothing has a phase
        pooled = {}
        for name, rows in table.groupby("timing_point", sort=False):
            n, mean, sd = rows[["n", "error_mean_pct", "error_sd_pct"]].to_numpy(dtype=float).T
            total = n.sum()
            centre = np.nansum(n * mean) / total if total else np.nan
            squares = np.nansum((n - 1.0) * sd**2) + np.nansum(n * (mean - centre) ** 2)
            pooled[name] = {
                "planned_pct": float(rows["planned_pct"].iloc[0]),
                **rows[list(_COUNTS)].sum().astype(int),
                "error_mean_pct": centre,
                "error_sd_pct": np.sqrt(squares / (total - 1.0)) if total > 1 else np.nan,
                "theory_sd_pct": rows["theory_sd_pct"].astype(float).pow(2).mean() ** 0.5,
            }
        return pd.DataFrame.from_dict(pooled, orient="index")

    def _draw(self, axes: "Axes") -> None:
        """Draw the SD of the onsets beside the theory, by timing point."""
        table = self.to_frame()
        axes.plot(table["planned_pct"], table["error_sd_pct"], "o", alpha=0.5, label="measured")
        theory = table.groupby("planned_pct")["theory_sd_pct"].mean()
        axes.plot(theory.index, theory.to_numpy(), "-", color="0.3", label="from stride variation")
        axes.set(xlabel="Planned onset (% of gait cycle)", ylabel="SD of onset (% of gait cycle)")
        axes.legend(frameon=False)


def _onset_sentence(row: Mapping[Any, Any]) -> str:
    if not row["n"]:
        return "no onsets"
    mean = f"onset error {row['error_mean_pct']:+.2f} % of the cycle"
    if isnan(row["error_sd_pct"]):
        return f"{mean}, one onset"
    return f"{mean}, SD {row['error_sd_pct']:.2f} (theory {row['theory_sd_pct']:.2f})"


@dataclass(frozen=True, slots=True, repr=False)
class StudyRun(PlottedResult):
    """A finished experiment.

    Parameters
    ----------
    study : pathlib.Path
        The study's folder, ready for :func:`jointz.analyze`.
    report : RunReport
        What was done.
    """

    SCHEMA: ClassVar[str] = "jointz.StudyRun/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = RunReport.FIGURE_SIZE

    study: Path
    report: RunReport

    def to_frame(self) -> pd.DataFrame:
        """Return the onsets as a table, one row a participant, condition and timing point."""
        return self.report.to_frame()

    def summary(self) -> str:
        """Return a few lines of text."""
        return f"{self.report.summary()}\nStudy: {self.study}"

    def _draw(self, axes: "Axes") -> None:
        """Draw the figure of the report."""
        self.report._draw(axes)
