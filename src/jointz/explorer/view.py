"""Selection of one browser: participant, timing point, pulse, method and parameter."""

from jointz.analysis.pulse_traces import PulseKey, PulseTrace, Window
from jointz.core.events import PulseRecord
from jointz.explorer.explorer_app import Explorer
from jointz.explorer.results_files import cell_of, pulses_of
from jointz.report.subjects import shown_parameters, timing_points
from jointz.report.wording import format_estimate
from jointz.results.estimates import CellEstimate, ParameterEstimate


class View:
    """The participant, timing point and pulse that a page shows."""

    def __init__(self, explorer: Explorer) -> None:
        self.explorer = explorer
        analysis = explorer.analysis
        self.person = next(iter(explorer.results.labels), "")
        self.point = next(iter(self.points()), "")
        self.picked: PulseKey | None = None
        self.method = str(analysis.settings["method"])
        self.quantity = "angle"
        self.parameter = next(iter(shown_parameters(analysis.cells)), "stiffness")

    @property
    def participant(self) -> str:
        """The id of the participant."""
        cells = self.explorer.results.analysed.cells
        return next((c.participant for c in cells if c.label == self.person), "")

    def points(self) -> list[str]:
        """Return the participant's timing points, in the order of the cycle."""
        cells = [c for c in self.explorer.analysis.cells if c.label == self.person]
        return timing_points(cells)

    def choose(self, *, person: str | None = None, point: str | None = None) -> None:
        """Select another participant or timing point; unknown ones are ignored."""
        if person in self.explorer.results.labels and person is not None:
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
        """Return the position of the selected pulse, None if there is no pulse."""
        keys = [PulseKey.of(pulse) for pulse in self.pulses()]
        if self.picked in keys:
            return keys.index(self.picked)
        return 0 if keys else None

    def pick(self, number: int) -> None:
        """Select another pulse; after the last comes the first."""
        pulses = self.pulses()
        if pulses:
            self.picked = PulseKey.of(pulses[number % len(pulses)])

    def pulse(self) -> PulseRecord | None:
        """Return the selected pulse."""
        number = self.number()
        return None if number is None else self.pulses()[number]

    def cell(self, method: str | None = None) -> CellEstimate | None:
        """Return the current estimate at the timing point."""
        return cell_of(self.explorer.analysis, self.person, self.point, method=method)

    def cell_as_analysed(self) -> CellEstimate | None:
        """Return the estimate of the results folder."""
        return cell_of(self.explorer.results.analysed, self.person, self.point)

    def trace_of(self, pulse: PulseRecord) -> PulseTrace | None:
        """Return the traces of a pulse, None until they are ready."""
        traces = self.explorer.traces(self.participant)
        return None if traces is None else traces.get(PulseKey.of(pulse))

    def window_of(self, pulse: PulseRecord) -> Window | None:
        """Return the window of a pulse by the selected method."""
        trace = self.trace_of(pulse)
        return None if trace is None else trace.windows.get(self.method)

    def window_methods(self) -> list[str]:
        """Return the methods with windows of the participant's pulses."""
        traces = self.explorer.traces(self.participant) or {}
        return list(dict.fromkeys(name for trace in traces.values() for name in trace.windows))


def estimate_or_status(parameter: ParameterEstimate) -> str:
    """Return an estimate with its interval, or why there is none."""
    if parameter.available:
        return format_estimate(parameter)
    return parameter.status.removeprefix("failed:").replace("_", " ")
