"""Computations that the commands consist of, beside the same in other packages."""

from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec

import numpy as np
import pandas as pd
from benchmarks.speed.cost import Figure, in_turns
from scipy.ndimage import gaussian_filter1d

from jointz.core.clock import VirtualClock
from jointz.rig.sim.rig import simulated_rig
from jointz.stats import mixed_model, sign_flip_max_t, spm_paired_t

PERIOD_NS, SUBSTEPS = 2_000_000, 10
#: jointz shall be at least as fast as a peer.
LEAST_RATIO = 1.0
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


def kernel_figures(rows: pd.DataFrame, *, quick: bool) -> list[Figure]:
    """Measure every kernel whose peer is installed; the mixed model on ``rows``."""
    kernels = {
        "mujoco": physics,
        "statsmodels": lambda *, quick: mixed(rows, quick=quick),
        "spm1d": curves,
    }
    installed = [measure for package, measure in kernels.items() if find_spec(package)]
    return [figure for measure in installed for figure in measure(quick=quick)]


def physics(*, quick: bool) -> list[Figure]:
    """Measure a step of 0.2 ms of the rig and of MuJoCo's equivalent one-joint model.

    That of jointz also moves the unperturbed path and the impedance over the gait cycle, friction,
    winding, goniometer and noise, and hands every sample of 2 ms to Python.
    """
    import mujoco

    n_samples = 200 if quick else 20_000
    model = mujoco.MjModel.from_xml_string(_MODEL)
    ours, theirs = in_turns(
        _rig_steps(n_samples), _mujoco_steps(mujoco, model, n_samples), 1 if quick else 7
    )
    micro = 1e6 / n_samples / SUBSTEPS
    times = (ours * micro, theirs * micro)
    return [_figure("step of the rig's physics, reads included", "us", "mj_step", "mujoco", times)]


def _rig_steps(n_samples: int) -> Callable[[], None]:
    def steps() -> None:
        clock = VirtualClock()
        devices = simulated_rig(0, preset="nominal").open(
            "unperturbed", worn=True, segment=0, clock=clock
        )
        for device in devices.all():
            device.configure()
            device.activate()
        read, command = devices.actuator.read, devices.actuator.command_torque
        for sample in range(n_samples):
            clock.wait_until_ns(sample * PERIOD_NS)
            read()
            command(5.0 if sample & 64 else 0.0)

    steps()  # compiles
    return steps


def _mujoco_steps(mujoco, model, n_samples: int) -> Callable[[], None]:
    def steps() -> None:
        data = mujoco.MjData(model)
        control = data.ctrl
        for sample in range(n_samples):
            control[0] = 5.0 if sample & 64 else 0.0
            mujoco.mj_step(model, data, SUBSTEPS)

    return steps


def mixed(rows: pd.DataFrame, *, quick: bool) -> list[Figure]:
    """Measure a mixed model with all tests beside the fit alone of statsmodels."""
    from statsmodels.formula.api import mixedlm

    def ours() -> None:
        fit = mixed_model(rows, response="y", within="level", participant="who")
        fit.pairs("bonferroni")

    ours()
    times = in_turns(
        ours, lambda: mixedlm("y ~ level", rows, groups="who").fit(reml=True), 1 if quick else 20
    )
    what = f"mixed model with all tests, {len(rows)} rows"
    return [_figure(what, "ms", "MixedLM, fit alone", "statsmodels", _in_ms(times))]


def curves(*, quick: bool) -> list[Figure]:
    """Measure tests of two curves of ten people over 101 nodes."""
    import spm1d

    noise = gaussian_filter1d(np.random.default_rng(0).standard_normal((20, 101)), 6.0, axis=1)
    a, b = noise[:10], noise[10:]

    def spm() -> None:
        spm1d.stats.ttest_paired(a, b).inference(0.05, two_tailed=True)

    def flips() -> None:
        test = spm1d.stats.nonparam.ttest_paired(a, b)
        test.inference(0.05, two_tailed=True, iterations=-1, force_iterations=True)

    compared = in_turns(lambda: spm_paired_t(a, b), spm, 1 if quick else 50)
    flipped = in_turns(lambda: sign_flip_max_t(a, b), flips, 1 if quick else 10)
    return [
        _figure("SPM, 10 people, 101 nodes", "ms", "ttest_paired", "spm1d", _in_ms(compared)),
        _figure(
            "1024 sign flips, 101 nodes", "ms", "nonparam.ttest_paired", "spm1d", _in_ms(flipped)
        ),
    ]


def _in_ms(times: tuple[float, float]) -> tuple[float, float]:
    return 1e3 * times[0], 1e3 * times[1]


def _figure(
    what: str, unit: str, function: str, package: str, times: tuple[float, float]
) -> Figure:
    peer = f"{function} ({package} {version(package)})"
    return Figure(what, unit, times[0], peer, times[1], LEAST_RATIO)
