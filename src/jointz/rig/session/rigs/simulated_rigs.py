"""Simulated rigs: a walking person, a step of a calibration, a bench."""

from jointz.core.protocols.protocol_models import LoadSpec
from jointz.rig.devices.interface import Rig
from jointz.rig.session.rigs.rig_settings import RigSettings


def open_simulated_rig(settings: RigSettings, number: int) -> Rig:
    """Return the simulated rig of one participant or load."""
    preset, seed, rate_hz = settings.preset, settings.seed, settings.sample_rate_hz
    if settings.bench is not None:
        from jointz.rig.sim.benches.bench_rig import simulated_bench

        load = settings.loads[number] if settings.loads else LoadSpec(name="bench")
        return simulated_bench(
            settings.bench, load, preset=preset, seed=seed, sample_rate_hz=rate_hz
        )
    if settings.step is not None:
        from jointz.rig.sim.calibration_benches.calibration_rig import calibration_rig

        return calibration_rig(
            number,
            settings.step,
            loads=settings.loads,
            preset=preset,
            seed=seed,
            sample_rate_hz=rate_hz,
        )
    from jointz.rig.sim.rig import simulated_rig

    # A goniometer whose zero is calibrated was not zeroed when it was taped on: a zeroed one would
    # be corrected for an offset that it does not have.
    known = settings.known
    people = () if known is None else known.participants
    return simulated_rig(
        number,
        preset=preset,
        seed=seed,
        sample_rate_hz=rate_hz,
        speed_m_s=settings.speed_m_s,
        sensors=settings.sensors,
        loads=settings.condition_loads,
        not_zeroed=[one for one in people if known and known.of(one).angle_zero_rad is not None],
    )
