"""A simulated bench with a known load, as an experiment is handed it."""

from jointz.core.errors import DataError
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.rig.sim.benches.bench_load import draw_load
from jointz.rig.sim.benches.loaded_bench import bench_stream
from jointz.rig.sim.benches.qdd_bench import draw_mounting, qdd_preset
from jointz.rig.sim.benches.qdd_bench_rig import QddBench
from jointz.rig.sim.benches.sea import draw_torque_gain, sea_preset
from jointz.rig.sim.benches.sea_bench_rig import SeaBench


def simulated_bench(
    bench: str, load: LoadSpec, *, preset: str = "nominal", seed: int = 1, sample_rate_hz: float
) -> SeaBench | QddBench:
    """Return a bench with one load.

    The bench is one and the same for all loads: its calibration error is drawn once.
    """
    hung = draw_load(load, seed=seed, spread=preset != "clean")
    gain = bench_stream(seed, "gain")
    if bench == "series-elastic":
        sea = draw_torque_gain(sea_preset(preset), gain)
        return SeaBench(sea, hung, seed=seed, sample_rate_hz=sample_rate_hz)
    if bench == "quasi-direct-drive":
        qdd = draw_mounting(qdd_preset(preset), gain)
        return QddBench(qdd, hung, seed=seed, sample_rate_hz=sample_rate_hz)
    raise DataError(f"bench: expected series-elastic or quasi-direct-drive; got {bench!r}.")
