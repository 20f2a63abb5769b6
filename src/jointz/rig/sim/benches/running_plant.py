"""A simulated walking person in the time of a clock, computed as far as devices are read."""

from collections import deque
from copy import deepcopy
from typing import Protocol

import numpy as np

from jointz.rig.sim.sensors.footswitch_model import ContactMaker
from jointz.rig.sim.sensors.moment_measurement import MomentMeasurement
from jointz.rig.sim.sensors.motion_sensors import MotionSensors, advance_and_measure
from jointz.rig.sim.sensors.sampled_time import Sample, SampledTime
from jointz.rig.sim.walking import plant
from jointz.rig.sim.walking.gait_motion import Stride
from jointz.rig.sim.walking.layout import HISTORY, STATE_SIZE, Noise, State
from jointz.rig.sim.walking.plant_build import PlantBuild


class Motion(Protocol):
    """Strides of an unperturbed path, one after the other without end."""

    def next(self) -> Stride:
        """Return the next stride; the first begins at time 0 or before it."""


_NOISE_ROWS = 4096
_NEVER_NS = 2**63


class RunningPlant(SampledTime):
    """One person walking from the first read or command on; purpose and segment seed the noise."""

    def __init__(self, build: PlantBuild, motion: Motion, *, purpose: str, segment: int) -> None:
        super().__init__(build.grid.period_ns)
        person, preset = build.person, build.preset
        self._timeout = round(preset.actuator.command_timeout_s * 1e9) // self._period_ns
        self._motion = motion
        self._contacts = ContactMaker(
            preset.footswitch,
            contact_share=preset.gait.contact_share,
            rng=person.stream(f"contact {purpose}", segment),
        )
        self._rng = person.stream(f"noise {purpose}", segment)
        self._moment = MomentMeasurement(build, purpose=purpose, segment=segment)
        self._moment_errors: list[float] = []
        self._sensors = MotionSensors(build, purpose=purpose, segment=segment)
        self._state = np.zeros(STATE_SIZE)
        history = np.zeros((HISTORY, plant.HISTORY_COLUMNS))
        self._person = build.params, self._state, build.curves, history
        self._noise = np.zeros((_NOISE_ROWS, len(Noise))), self._sensors.noise(0)
        self._command = 0.0
        self._commanded = 0
        self._toggles = deque((_NEVER_NS,))
        self._contact = 0.0
        self._next_stride = motion.next()
        self._load_stride()
        plant.begin(build.params, self._state, self.stride.row, history)
        self._compile()

    def command(self, torque_nm: float, now_ns: int) -> None:
        """Command a torque of the actuator."""
        self.look(now_ns)
        self._command = torque_nm
        self._commanded = self.samples - 1

    def release(self, now_ns: int) -> None:
        """Release the torque of the actuator."""
        self.command(0.0, now_ns)

    def fail(self, bits: int) -> None:
        """Set fault bits of the actuator: it goes to zero current by itself."""
        self._state[State.FAULT] = float(int(self._state[State.FAULT]) | bits)

    @property
    def motion_channels(self) -> tuple[str, ...]:
        """Channels of encoder and gyroscopes that are measured."""
        return self._sensors.channels

    def _compile(self) -> None:
        """Take a step without effect: the first one compiles, or loads the compiled code."""
        person, sensors = deepcopy(self._person), deepcopy(self._sensors.arrays)
        advance_and_measure(person, sensors, self._row, self._noise, 1, 0.0)

    def _step(self) -> None:
        sample = self.samples
        # The stride of the sample before: physics advances from there.
        if (sample - 1) * self._period_ns >= self._stride_end_ns:
            self._load_stride()
        if sample % _NOISE_ROWS == 0:
            self._rng.standard_normal(out=self._noise[0])
            self._moment_errors = self._moment.errors(_NOISE_ROWS).tolist()
            self._noise = self._noise[0], self._sensors.noise(_NOISE_ROWS)
        if sample - 1 - self._commanded >= self._timeout:
            self._command = 0.0
        motor, angle, moment, motion = advance_and_measure(
            self._person, self._sensors.arrays, self._row, self._noise, sample, self._command
        )
        time_ns = sample * self._period_ns
        while time_ns >= self._toggles[0]:
            self._toggles.popleft()
            self._contact = 1.0 - self._contact
        moment = self._moment.gain * moment + self._moment_errors[sample % _NOISE_ROWS]
        newest: Sample = (time_ns, motor, angle, self._contact, moment, *motion)
        for queue in self._queues:
            queue.append(newest)
        self.samples = sample + 1

    def _load_stride(self) -> None:
        """Go on to the next stride; its successor's contacts may begin before it does."""
        self.stride: Stride = self._next_stride
        self._row = self.stride.row
        self._next_stride = self._motion.next()
        self._stride_end_ns = round(self.stride.end_s * 1e9)
        self._state[State.PATH_KNOWN] = 0.0
        following = self._next_stride
        times = self._contacts.toggles(following.start_s, following.duration_s)
        self._toggles.pop()
        self._toggles.extend(round(time_s * 1e9) for time_s in times)
        self._toggles.append(_NEVER_NS)
