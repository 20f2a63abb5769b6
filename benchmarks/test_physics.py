"""A step of the simulated rig's physics beside MuJoCo's on an equivalent one-joint model.

Both take steps of 0.2 ms by Runge and Kutta's fourth-order method, ten to a
sample of 2 ms: a hinge with stiffness, damping and inertia, driven by an actuator
with a first-order lag. Ours also moves the unperturbed path and the impedance
over the gait cycle, friction, winding, goniometer and noise, and hands the sample
to Python. The two sides take turns. MuJoCo is no dependency of the project: without
it only our figure is shown. With ``--benchmark-disable`` all runs once and short.
"""

from collections.abc import Callable
from time import perf_counter

from benchmarks.figures import Figures, at_least, of_package

from jointz.core.clock import VirtualClock
from jointz.sim.rig import simulated_rig

PERIOD_NS, SUBSTEPS = 2_000_000, 10
N_TURNS, N_SAMPLES = 7, 20_000

_MODEL = """
<mujoco>
  <option timestep="0.0002" integrator="RK4" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="knee" type="hinge" axis="0 1 0" stiffness="60" damping="2" armature="0.01"/>
      <geom type="capsule" size="0.04" fromto="0 0 0 0 0 -0.3" mass="1.5"
            contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator>
    <general joint="knee" dyntype="filter" dynprm="0.012" gainprm="1"/>
  </actuator>
</mujoco>
"""


def ours(n_samples: int) -> float:
    clock = VirtualClock()
    devices = simulated_rig(0, preset="nominal").open(
        "unperturbed", worn=True, segment=0, clock=clock
    )
    for device in devices.all():
        device.configure()
        device.activate()
    read, command = devices.actuator.read, devices.actuator.command_torque
    start = perf_counter()
    for sample in range(n_samples):
        clock.wait_until_ns(sample * PERIOD_NS)
        read()
        command(5.0 if sample & 64 else 0.0)
    return (perf_counter() - start) / n_samples / SUBSTEPS


def make_peer() -> Callable[[int], float] | None:
    try:
        import mujoco
    except ImportError:
        return None
    model = mujoco.MjModel.from_xml_string(_MODEL)

    def peer(n_samples: int) -> float:
        data = mujoco.MjData(model)
        control = data.ctrl
        start = perf_counter()
        for sample in range(n_samples):
            control[0] = 5.0 if sample & 64 else 0.0
            mujoco.mj_step(model, data, SUBSTEPS)
        return (perf_counter() - start) / n_samples / SUBSTEPS

    return peer


def test_a_step_of_the_physics(quick: bool, figures: Figures) -> None:
    turns, n_samples = (1, 200) if quick else (N_TURNS, N_SAMPLES)
    peer = make_peer()
    ours(200)  # compiles
    mine, theirs = [], []
    for _ in range(turns):
        mine.append(ours(n_samples))
        if peer is not None:
            theirs.append(peer(n_samples))
    print(f"\njointz  {1e6 * min(mine):6.3f} us a step of the physics, reads included")
    what = "step of the rig's physics, reads included"
    if peer is None:
        figures.alone(what, 1e6 * min(mine), "us")
        figures.left_out(f"{what}, beside MuJoCo's", "mujoco is not installed")
    else:
        both = (1e6 * min(mine), 1e6 * min(theirs))
        figures.beside(what, of_package("mj_step", "mujoco"), both, "us", asked=at_least(1.0))
        ratio = min(theirs) / min(mine)
        print(f"MuJoCo  {1e6 * min(theirs):6.3f} us a step: ours is {ratio:.1f} times as fast")
        assert quick or ratio > 1.0
