"""Hill-type muscles with elastic tendons, activation and a yielding short-range stiffness."""

import numpy as np
from numba import njit

MUSCLES = ("vasti", "rectus", "hamstrings", "gastrocnemius", "biceps_short")
N_MUSCLES = len(MUSCLES)
# Columns of the parameters of muscles, one row per muscle
(F_MAX, L_OPT, L_SLACK, V_MAX, COS_PENNATION, ARM_KNEE, ARM_HIP, ARM_ANKLE, LENGTH_0, TENDON_STRAIN,
 SRS_GAIN, SRS_YIELD, RISE_S, DECAY_S, GAIN_LENGTH, GAIN_SPEED, THRESHOLD, ARM_CURVE,
) = range(18)  # fmt: skip
# Columns of the state of muscles
ACTIVATION, FIBRE, SPEED, BRISTLE = range(4)

FIBRE_DAMPING = 0.1
SRS_DETACH_S = 0.12
ECCENTRIC = 1.35
REFERENCE_KNEE = 0.7  # the knee angle where the patellar arm is largest, rad


@njit
def tendon_force(strain, strain_0):
    """Return force over maximum force of a tendon (Thelen 2003)."""
    toe = 0.609 * strain_0
    if strain <= 0.0:
        return 0.0
    if strain < toe:
        return 0.33 * (np.exp(3.0 * strain / toe) - 1.0) / (np.exp(3.0) - 1.0)
    return 1.712 / strain_0 * (strain - toe) + 0.33


@njit
def force_length(length):
    """Return the active force-length factor at a normalised fibre length."""
    return np.exp(-(((length - 1.0) / 0.5) ** 2))


@njit
def passive_force(length):
    """Return the passive fibre force over maximum force."""
    if length <= 1.0:
        return 0.0
    return (np.exp(4.0 * (length - 1.0) / 0.7) - 1.0) / (np.exp(4.0) - 1.0)


@njit
def force_velocity(speed):
    """Return the force-velocity factor and its slope; speed over maximum speed, lengthening > 0."""
    if speed < 0.0:
        below = 1.0 - 4.0 * speed
        return (1.0 + speed) / below, 5.0 / below**2
    scale = (ECCENTRIC - 1.0) / 5.0
    above = speed + scale
    return 1.0 + (ECCENTRIC - 1.0) * speed / above, (ECCENTRIC - 1.0) * scale / above**2


@njit
def path(par, hip, knee, ankle):
    """Return length of a muscle and tendon and its derivative by the knee angle."""
    bent = knee - REFERENCE_KNEE
    arm = par[ARM_KNEE] * (1.0 - par[ARM_CURVE] * bent * bent)
    length = par[LENGTH_0] + par[ARM_KNEE] * (bent - par[ARM_CURVE] * bent**3 / 3.0)
    return length + par[ARM_HIP] * hip + par[ARM_ANKLE] * ankle, arm


@njit
def step_muscle(par, state, length, rate, excitation, frozen, dt):
    """Advance one muscle by `dt` (two steps inside); return the tendon force in N."""
    half = 0.5 * dt
    force = 0.0
    for k in range(2):
        if frozen >= 0.0:
            state[ACTIVATION] = frozen
        else:
            rising = excitation > state[ACTIVATION]
            tau = par[RISE_S] if rising else par[DECAY_S]
            state[ACTIVATION] += half * (excitation - state[ACTIVATION]) / tau
        fibre = state[FIBRE]
        tendon = length + rate * half * k - fibre * par[L_OPT] * par[COS_PENNATION]
        pull = tendon_force(tendon / par[L_SLACK] - 1.0, par[TENDON_STRAIN])
        active = state[ACTIVATION] * force_length(fibre)
        target = pull / par[COS_PENNATION] - passive_force(fibre)
        target -= active * par[SRS_GAIN] * state[BRISTLE]
        speed = state[SPEED]
        for _ in range(4):
            factor, slope = force_velocity(speed)
            miss = active * factor + FIBRE_DAMPING * speed - target
            speed -= miss / (active * slope + FIBRE_DAMPING)
            speed = min(max(speed, -0.98), 2.0)
        state[SPEED] = speed
        moved = speed * par[V_MAX]
        state[FIBRE] = min(max(fibre + half * moved, 0.3), 1.8)
        # Cross-bridges stretch with the fibre, slip beyond their range and detach in time
        loss = abs(moved) / par[SRS_YIELD] + 1.0 / SRS_DETACH_S
        kept = np.exp(-half * loss)
        state[BRISTLE] = state[BRISTLE] * kept + moved / loss * (1.0 - kept)
        force = par[F_MAX] * pull
    return force


@njit
def passive_knee(knee, speed, scale, viscous):
    """Return the passive flexing torque of the knee (Riener and Edrich 1999)."""
    deg = knee * 57.29577951308232
    elastic = np.exp(1.8 - 0.0352 * deg) - np.exp(-3.971 + 0.0495 * deg) - 4.82
    elastic += np.exp(2.22 - 0.15 * deg)
    return scale * elastic - viscous * speed


@njit
def spindle(par, state):
    """Return the afferent drive of a muscle from length and speed of its fibres."""
    speed = state[SPEED] * par[V_MAX]
    drive = par[GAIN_LENGTH] * (state[FIBRE] - 1.0)
    drive += par[GAIN_SPEED] * speed / np.sqrt(1.0 + (speed / 1.5) ** 2)
    return max(0.0, drive - par[THRESHOLD])


@njit
def torque_along(pars, states, joints, rates, activations, passive, dt):
    """Return the knee torque of muscles and passive tissue along a given motion and activation."""
    torque = np.empty(len(joints))
    for i in range(len(joints)):
        total = passive_knee(joints[i, 1], rates[i, 1], passive[0], passive[1])
        for m in range(len(pars)):
            length, arm = path(pars[m], joints[i, 0], joints[i, 1], joints[i, 2])
            rate = arm * rates[i, 1] + pars[m, ARM_HIP] * rates[i, 0]
            rate += pars[m, ARM_ANKLE] * rates[i, 2]
            force = step_muscle(pars[m], states[m], length, rate, 0.0, activations[i, m], dt)
            total -= arm * force
        torque[i] = total
    return torque
