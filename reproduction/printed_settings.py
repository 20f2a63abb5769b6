"""Settings of simulated benches and people that were taken from print."""

from operator import attrgetter
from typing import Final

from jointz.core.gait_phases import TIMING_POINTS
from jointz.io.protocols import load_protocol
from jointz.reference import Printed, chapter2, chapter3, chapter4
from jointz.rig.sim import people
from jointz.rig.sim.benches.qdd_bench import qdd_preset
from jointz.rig.sim.benches.sea import sea_preset
from jointz.rig.sim.presets import preset as people_preset
from reproduction import printed_numbers
from reproduction.reproduction_tables import Compared, ComparedTable, compare, texts

#: Starts of the names of settings, which results name as ``built_in``.
TORQUE_LOOP, MODEL, SPRING, SENSOR_NOISE = "torque loop", "model 3.3", "spring", "sensor noise"
PEOPLE: Final = {name: f"people's {text}" for name, text in printed_numbers.PARAMETER_NAMES.items()}

_TUNED: Final = "not printed; tuned to the bandwidths of 2.3.1"
_CONSTANTS: Final = chapter3.TORQUE_MODELS["3.3"]
#: Chapter, attribute of the preset, name, printed value or where the value is from.
_SETTINGS: Final[tuple[tuple[int, str, str, Printed | str], ...]] = (
    (2, "machine.beam_stiffness", "beam", Printed(274e3, None, "N/m", "2.2.1")),
    (2, "machine.screw_lead_m", "lead of the screw", Printed(0.0025, None, "m", "2.2.1")),
    (2, "machine.belt_ratio", "belt", Printed(2.0, None, "", "2.2.1")),
    (2, "machine.stiffness", "intrinsic stiffness", chapter2.INTRINSIC_STIFFNESS),
    (2, "machine.damping", "intrinsic damping", chapter2.INTRINSIC_DAMPING),
    (2, "machine.inertia", "intrinsic inertia", chapter2.INTRINSIC_INERTIA),
    (2, "machine.supply_v", f"{TORQUE_LOOP}: supply voltage, V", _TUNED),
    (2, "machine.current_max_a", f"{TORQUE_LOOP}: current limit, A", _TUNED),
    (2, "control.torque_gain", f"{TORQUE_LOOP}: gain", _TUNED),
    (2, "control.torque_rate_gain_s", f"{TORQUE_LOOP}: gain on the rate, s", _TUNED),
    *(
        (chapter, f"{part}.{name}", f"{MODEL}: {name.replace('_', ' ')}", number)
        for chapter, part in ((3, "machine"), (4, "actuator"))
        for name, number in _CONSTANTS.items()
        if name != "bias"
    ),
    (3, "errors.sensor_bias_nm", f"{MODEL}: bias", _CONSTANTS["bias"]),
    (3, "errors.sensor_noise_nm", f"{SENSOR_NOISE}, SD", printed_numbers.CHIRP_RMS),
)


def printed_settings(chapter: int, preset: str) -> ComparedTable:
    """Return the settings of a chapter's simulation that were taken from print."""
    settings = {2: sea_preset, 3: qdd_preset, 4: people_preset}[chapter](preset)
    own = [setting[1:] for setting in _SETTINGS if setting[0] == chapter]
    rows = [_row(name, attrgetter(key)(settings), number) for key, name, number in own]
    if chapter == 3:
        spring = attrgetter("stiffness.value")(load_protocol("qdd-static").loads[0])
        rows.append(_row(SPRING, spring, chapter3.DITHER_STIFFNESS))
    rows += _of_people() if chapter == 4 else []
    return ComparedTable("printed_settings", **texts()["printed_settings"], rows=tuple(rows))


def _row(name: str, value: float, printed: Printed | str) -> Compared:
    if isinstance(printed, str):
        return compare(name, truth=value, note=printed)
    return compare(name, printed.unit, printed, truth=value, note=printed.source)


def _of_people() -> list[Compared]:
    means = (people.MEAN_STIFFNESS_PER_MASS, people.MEAN_DAMPING_PER_MASS)
    drawn, name = "not printed; kg*m^2, drawn for each person", f"{PEOPLE['inertia']}, end of range"
    return [
        _row("effect of the device on gait", 0.0, "none, as 4.3.1 and 4.4 state"),
        *(_row(name, value, drawn) for value in people.INERTIA_RANGE),
        *(
            _row(f"{PEOPLE[key]}, mean at {point}", value, chapter4.MEANS[key][point])
            for key, values in zip(PEOPLE, means, strict=False)
            for point, value in zip(TIMING_POINTS, values, strict=True)
        ),
    ]
