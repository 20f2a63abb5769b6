"""What one browser looks at, of results that several share."""

from jointz.core.events import PulseRecord
from jointz.explorer.explorer_app import Explorer
from jointz.explorer.results_files import cell_of, pulses_of
from jointz.explorer.traces import PulseKey, PulseTrace, Window
from jointz.report.subjects import shown_parameters, timing_points
from jointz.results.estimates import CellEstimate


class View:
    """The participant, timing point and pulse that a page shows."""

    def __init__(self, explorer: Explorer) -> None:
        self.explorer = explorer
        analysis = explorer.analysis
        self.person = next(iter(explorer.found.labels), "")
        self.point = next(iter(self.points()), "")
        self.picked: PulseKey | None = None
        self.method = str(analysis.settings["method"])
        self.quantity = "angle"
        self.parameter = next(iter(shown_parameters(analysis)), "stiffness")

    @property
    def participant(self) -> str:
        """The id of the participant."""
        cells = self.explorer.found.analysed.cells
        return next((c.participant for c in cells if c.label == self.person), "")

    def points(self) -> list[str]:
        """Return the participant's timing points, in the order of the cycle."""
        cells = [c for c in self.explorer.analysis.cells if c.label == self.person]
        return timing_points(cells)

    def choose(self, *, person: str | None = None, point: str | None = None) -> None:
        """Look at another participant or timing point; what is not known is ignored."""
        if person in self.explorer.found.labels and person is not None:
            self.person = person
            if self.point not in self.points():
                self.point = next(iter(self.points()), "")
        if point in self.points() and point is not None:
            self.point = point
        self.picked = None

    def pulses(self) -> tuple[PulseRecord, ...]:
        """Return the pulses at the timing point."""
        return pulses_of(self.explorer.analysis, self.person, self.point)

    def number(self) -> int | None:
        """Return the place of the pulse that is looked at, None where there is none."""
        keys = [PulseKey.of(pulse) for pulse in self.pulses()]
        if self.picked in keys:
            return keys.index(self.picked)
        return 0 if keys else None

    def pick(self, number: int) -> None:
        """Look at another pulse; beyond the last comes the first."""
        pulses = self.pulses()
        if pulses:
            self.picked = PulseKey.of(pulses[number % len(pulses)])

    def pulse(self) -> PulseRecord | None:
        """Return the pulse that is looked at."""
        number = self.number()
        return None if number is None else self.pulses()[number]

    def cell(self, method: str | None = None) -> CellEstimate | None:
        """Return the estimate at the timing point as it stands now."""
        return cell_of(self.explorer.analysis, self.person, self.point, method=method)

    def cell_as_analysed(self) -> CellEstimate | None:
        """Return the estimate of the results folder."""
        return cell_of(self.explorer.found.analysed, self.person, self.point)

    def trace_of(self, pulse: PulseRecord) -> PulseTrace | None:
        """Return what a pulse was estimated from, None until that is known."""
        traces = self.explorer.traces(self.participant)
        return None if traces is None else traces.get(PulseKey.of(pulse))

    def window_of(self, pulse: PulseRecord) -> Window | None:
        """Return what the method makes of a pulse."""
        trace = self.trace_of(pulse)
        return None if trace is None else trace.windows.get(self.method)

    def window_methods(self) -> list[str]:
        """Return the methods that show windows of the participant's pulses."""
        traces = self.explorer.traces(self.participant) or {}
        return list(dict.fromkeys(name for trace in traces.values() for name in trace.windows))
