"""A plant that runs on the time of a clock, as far as somebody looks at it."""

from collections import deque
from typing import NamedTuple

import numpy as np

from jointz.sim import plant
from jointz.sim.footswitch import ContactMaker
from jointz.sim.gait_motion import GaitMotion, Stride
from jointz.sim.layout import HISTORY, STATE_SIZE, Noise, State
from jointz.sim.plant import Measured
from jointz.sim.plant_build import PlantBuild

_NOISE_ROWS = 4096


class Sample(NamedTuple):
    """What all devices measure at one time.

    Parameters
    ----------
    time_ns : int, ns
        On the devices' clock: 0 at the first sample.
    measured : tuple
        As :func:`jointz.sim.plant.advance` returns it.
    contact : float
        1 with the foot on the ground.
    """

    time_ns: int
    measured: Measured
    contact: float


class RunningPlant:
    """One person walking, from the first look on.

    Samples lie on whole multiples of the sample period of the clock. The first
    look or command decides which of them is the first sample, time 0 of the
    devices' clock, so that a session starts the same under any clock. Looking
    at host time t computes all samples up to t; a command given between two
    samples acts from the earlier one on.

    Parameters
    ----------
    build : PlantBuild
        The constants.
    motion : GaitMotion
        Strides, from the first on.
    contacts : ContactMaker
        Of the footswitch.
    noise : numpy.random.Generator
        Drawn from in blocks, by nobody else.

    Attributes
    ----------
    stride : Stride
        The one that the newest sample lies in.
    samples : int
        Computed so far.
    """

    def __init__(
        self,
        build: PlantBuild,
        *,
        motion: GaitMotion,
        contacts: ContactMaker,
        noise: np.random.Generator,
    ) -> None:
        self._params, self._curves = build.params, build.curves
        self._substeps = build.grid.substeps
        self._period_ns = build.grid.period_ns
        timeout_s = build.preset.actuator.command_timeout_s
        self._timeout = round(timeout_s * 1e9) // self._period_ns
        self._motion, self._contacts, self._rng = motion, contacts, noise
        self._state = np.zeros(STATE_SIZE)
        self._history = np.zeros((HISTORY, plant.HISTORY_COLUMNS))
        self._scratch = np.zeros(plant.SCRATCH_SIZE)
        self._noise = np.zeros((_NOISE_ROWS, len(Noise)))
        self._queues: list[list[Sample]] = []
        self._origin: int | None = None
        self._command = 0.0
        self._commanded = 0
        self._toggles: deque[int] = deque()
        self._contact = 0.0
        self._next_stride = motion.next()
        self.samples = 0
        self._load_stride()
        plant.begin(self._params, self._state, self.stride.row, self._history)

    def queue(self) -> list[Sample]:
        """Return a new list to which every sample from now on is appended."""
        samples: list[Sample] = []
        self._queues.append(samples)
        return samples

    def forget(self, queue: list[Sample]) -> None:
        """Append no more to a list.

        Parameters
        ----------
        queue : list of Sample
            From :meth:`queue`.
        """
        self._queues = [kept for kept in self._queues if kept is not queue]

    def look(self, now_ns: int) -> None:
        """Compute all samples up to a time of the host.

        Parameters
        ----------
        now_ns : int, ns
            By the clock.
        """
        slot = now_ns // self._period_ns
        if self._origin is None:
            self._origin = slot
        last = slot - self._origin
        while self.samples <= last:
            self._step()

    def command(self, torque_nm: float, now_ns: int) -> None:
        """Ask the actuator for a torque.

        Parameters
        ----------
        torque_nm : float, N*m
            Wanted.
        now_ns : int, ns
            By the clock.
        """
        self.look(now_ns)
        self._command = torque_nm
        self._commanded = self.samples - 1

    def fail(self, bits: int) -> None:
        """Set fault bits of the actuator: it goes to zero current by itself.

        Parameters
        ----------
        bits : int
            See :class:`jointz.sim.layout.Fault`.
        """
        self._state[State.FAULT] = float(int(self._state[State.FAULT]) | bits)

    def _step(self) -> None:
        sample = self.samples
        # The stride of the sample before: physics advances from there.
        if (sample - 1) * self._period_ns >= self._stride_end_ns:
            self._load_stride()
        row = sample % _NOISE_ROWS
        if row == 0:
            self._rng.standard_normal(out=self._noise)
        if sample - 1 - self._commanded >= self._timeout:
            self._command = 0.0
        measured = plant.advance(
            self._params,
            self._state,
            self._curves,
            self._history,
            self.stride.row,
            self._scratch,
            self._noise,
            sample,
            row,
            self._command,
            self._substeps,
        )
        time_ns = sample * self._period_ns
        while self._toggles and self._toggles[0] <= time_ns:
            self._toggles.popleft()
            self._contact = 1.0 - self._contact
        taken = Sample(time_ns, measured, self._contact)
        for queue in self._queues:
            queue.append(taken)
        self.samples = sample + 1

    def _load_stride(self) -> None:
        """Go on to the next stride; its successor's contacts may begin before it does."""
        self.stride: Stride = self._next_stride
        self._next_stride = self._motion.next()
        self._stride_end_ns = round(self.stride.end_s * 1e9)
        self._state[State.PATH_KNOWN] = 0.0
        following = self._next_stride
        times = self._contacts.toggles(following.start_s, following.duration_s)
        self._toggles.extend(round(time_s * 1e9) for time_s in times)
