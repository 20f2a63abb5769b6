"""Simulation of free deviations of a passive load on a periodic impedance, and their growth."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

NODES = 100
INERTIA = (0.2, 0.8)  # kg*m^2
STRIDE = (0.8, 1.2)  # of the mean stride time
LARGEST_SPRING = 10.0  # of the mean stiffness
STRIDES = (30, 60)  # growth is measured between the ends of these strides
STEPS = 6  # of the integrator between two nodes


@dataclass(frozen=True, slots=True)
class Load:
    """A passive load and a stride time."""

    inertia: float  # kg*m^2
    spring: float  # N*m/rad, to ground
    stride_s: float


@dataclass(frozen=True, slots=True)
class Box:
    """Bounds of the loads that a search covers."""

    inertia: tuple[float, float] = INERTIA
    stride: tuple[float, float] = STRIDE  # of the mean stride time
    spring: tuple[float, float] = (0.0, LARGEST_SPRING)  # of the mean stiffness


WHOLE = Box()


def between_nodes(values, steps):
    """Return values at equal steps over one cycle, linear between nodes, both ends included."""
    at = np.arange(NODES * steps + 1) / steps
    return np.interp(at, np.arange(NODES + 1), np.append(values, values[0]))


def after_one_stride(stiffness, damping, loads, steps=STEPS):
    """Return (2, 2, n_load) states after a stride from unit deviation and unit velocity (RK4)."""
    inertia, spring, stride_s = loads
    k, b = between_nodes(stiffness, 2 * steps), between_nodes(damping, 2 * steps)
    per_inertia, h = stride_s / inertia, 1.0 / (NODES * steps)
    x = np.stack([np.ones_like(inertia), np.zeros_like(inertia)])
    v = x[::-1].copy()

    def slope(i, x, v):
        return stride_s * v, -per_inertia * (b[i] * v + (k[i] + spring) * x)

    for i in range(0, len(k) - 1, 2):
        x1, v1 = slope(i, x, v)
        x2, v2 = slope(i + 1, x + h / 2 * x1, v + h / 2 * v1)
        x3, v3 = slope(i + 1, x + h / 2 * x2, v + h / 2 * v2)
        x4, v4 = slope(i + 2, x + h * x3, v + h * v3)
        x, v = x + h / 6 * (x1 + 2 * (x2 + x3) + x4), v + h / 6 * (v1 + 2 * (v2 + v3) + v4)
    return np.stack([x, v])


def growth(stiffness, damping, loads, steps=STEPS):
    """Return the growth factor a stride, (n_load,), of the energy norm of two free deviations.

    The equation is linear and periodic: the states after one stride give those after 60.
    """
    inertia, spring, _ = loads
    one = after_one_stride(stiffness, damping, loads, steps)
    x, v = np.stack([np.ones_like(inertia), np.zeros_like(inertia)]), np.zeros((2, inertia.size))
    v[1] = np.sqrt((stiffness[0] + spring) / inertia)  # of the same energy
    total = np.zeros_like(inertia)
    for stride in range(1, STRIDES[1] + 1):
        x, v = one[0, 0] * x + one[0, 1] * v, one[1, 0] * x + one[1, 1] * v
        energy = (inertia * v**2 + (stiffness[0] + spring) * x**2).sum(axis=0)
        norm = np.sqrt(energy)
        x, v = x / norm, v / norm  # so that 60 strides neither overflow nor vanish
        if stride > STRIDES[0]:
            total += np.log(norm)
    return np.exp(total / (STRIDES[1] - STRIDES[0]))


def multiplier(stiffness, damping, loads, steps=STEPS):
    """Return the largest modulus of a Floquet multiplier, (n_load,)."""
    one = after_one_stride(stiffness, damping, loads, steps)
    return np.abs(np.linalg.eigvals(np.moveaxis(one, -1, 0))).max(axis=-1)


def growth_by_solve_ivp(stiffness, damping, load):
    """Return the growth factor a stride at one load, all 60 strides integrated by DOP853."""
    k, b = (between_nodes(values, 1) for values in (stiffness, damping))
    nodes = np.arange(NODES + 1)

    def slope(t, state):
        at = (t / load.stride_s * NODES) % NODES
        x, v = state[:2], state[2:]
        force = np.interp(at, nodes, b) * v + (np.interp(at, nodes, k) + load.spring) * x
        return np.concatenate([v, -force / load.inertia])

    def norm(state):
        x, v = state[:2], state[2:]
        return np.sqrt(np.sum(load.inertia * v**2 + (k[0] + load.spring) * x**2))

    omega = np.sqrt((k[0] + load.spring) / load.inertia)
    state, norms = np.array([1.0, 0.0, 0.0, omega]), []
    for stride in range(STRIDES[1]):
        span = (stride * load.stride_s, (stride + 1) * load.stride_s)
        state = solve_ivp(
            slope, span, state, method="DOP853", rtol=1e-8, atol=1e-10 * omega,
            max_step=load.stride_s / NODES,
        ).y[:, -1]  # fmt: skip
        norms.append(norm(state))
        state = state / norms[-1]
    return float(np.exp(np.mean(np.log(norms[STRIDES[0] :]))))


def grid(mean_stiffness, mean_stride_s, box, counts):
    """Return (3, n) inertias, springs and stride times; natural frequencies are evenly spaced."""
    inertias = np.geomspace(*box.inertia, counts[0])
    roots = np.linspace(*np.sqrt(1.0 + np.array(box.spring)), counts[1])
    strides = np.linspace(*box.stride, counts[2]) * mean_stride_s
    mesh = np.meshgrid(inertias, (roots**2 - 1.0) * mean_stiffness, strides, indexing="ij")
    return np.stack([axis.ravel() for axis in mesh])


def best_of_grid(cycle, box, counts, steps, starts):
    """Return (3, n) loads, the best ones of the lines along the spring, and their factors."""
    loads = grid(cycle.stiffness.mean(), cycle.stride_s, box, counts)
    factors = growth(cycle.stiffness, cycle.damping, loads, steps)
    springs = factors.reshape(counts).argmax(axis=1)
    lines = np.arange(counts[0])[:, None], springs, np.arange(counts[2])[None, :]
    best = np.ravel_multi_index(lines, counts).ravel()
    best = best[np.argsort(factors[best])[::-1][:starts]]
    return loads[:, best], factors[best]


def neighbours(centres, width, mean):
    """Return (3, n_centre, n) loads around centres; width is relative.

    The spring follows inertia and stride time, so that the natural frequency times the stride time
    changes with one axis only: resonances are narrow along it.
    """
    axes = np.meshgrid(*[np.linspace(-1, 1, n) for n in (5, 9, 5)], indexing="ij")
    factors = 1.0 + np.stack([axis.ravel() for axis in axes]) * width[:, None]
    inertia, spring, stride_s = centres[:, :, None]
    stiffness = (spring + mean) * factors[1] * factors[0] / factors[2] ** 2
    return np.stack([inertia * factors[0], stiffness - mean, stride_s * factors[2]])


def largest_growth(cycle, box=WHOLE, *, counts=(7, 1000, 5), steps=STEPS, zooms=4, starts=10):
    """Return the load of a box with the largest growth factor, and the factor.

    The grid is dense in the spring, along which every resonance is crossed; the neighbourhoods of
    the best loads at each inertia and stride time are searched on finer grids.
    """
    mean = cycle.stiffness.mean()
    units = np.array([1.0, mean, cycle.stride_s])
    low, high = (units * np.array([box.inertia, box.spring, box.stride]).T)[:, :, None, None]
    centres, top = best_of_grid(cycle, box, counts, steps, starts)
    width, each = np.array([0.15, 0.02, 0.07]), np.arange(top.size)
    for _ in range(zooms):
        loads = np.clip(neighbours(centres, width, mean), low, high)
        flat = loads.reshape(3, -1)
        factors = growth(cycle.stiffness, cycle.damping, flat, steps).reshape(loads.shape[1:])
        best = factors.argmax(axis=1)
        better = factors[each, best] > top
        centres = np.where(better, loads[:, each, best], centres)
        top = np.maximum(top, factors[each, best])
        width = width / 3.0
    winner = int(top.argmax())
    return Load(*(float(value) for value in centres[:, winner])), float(top[winner])
