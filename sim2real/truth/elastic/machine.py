r"""Pump, rags and induction machine: head over flow, torque over slip.

The shaft turns by

$$T \frac{dn}{dt} = \frac{2 m}{\sigma / \sigma_b + \sigma_b / \sigma} - \tau(n, q), \qquad \sigma = c - n$$

with c the frequency and n the speed over their rated ones, m the breakdown torque at slip $\sigma_b$ (Kloss) and τ
the torque of the impeller; its steps are implicit and found by Newton's method.

References
----------
.. [1] After T. Wildi, Electrical Machines, Drives, and Power Systems: equation of Kloss.
.. [2] After J. F. Gülich, Centrifugal Pumps, Springer: power curves, leakage of wear rings.
"""

import math

from wetwell.protocols.jit import inlined
from wetwell.sim2real.truth.elastic.pipe import TICK_S
from wetwell.sim2real.truth.elastic.spec import EARLY, SMOOTH, ElasticSpec

_SPEED_TRIES = 12
EARLY_SHARE = 0.4
"""Share of the time of an early ramp in which it does its first part."""


@inlined
def given_frequency(spec: ElasticSpec, told: float) -> float:
    """Frequency that the drive gives for the one that it tells, over the rated one."""
    if spec.ramp_form == EARLY:
        knee = EARLY_SHARE + spec.ramp_bend * (1.0 - EARLY_SHARE)
        if told < EARLY_SHARE:
            return told * knee / EARLY_SHARE
        return knee + (told - EARLY_SHARE) * (1.0 - knee) / (1.0 - EARLY_SHARE)
    if spec.ramp_form == SMOOTH:
        return (1.0 - spec.ramp_bend) * told + spec.ramp_bend * told**2 * (3.0 - 2.0 * told)
    return told


@inlined
def load_torque(spec: ElasticSpec, speed: float, flow: float, rated_flow: float) -> float:
    """Torque of the impeller over the rated one."""
    return speed * (spec.shutoff_share * speed + (1.0 - spec.shutoff_share) * max(flow, 0.0) / rated_flow)


@inlined
def turned(spec: ElasticSpec, frequency: float, before: float, flow: float, rated_flow: float) -> float:
    """Speed of the shaft, over the synchronous one at rated frequency, after a step."""
    if frequency <= 0.0:
        return 0.0
    speed = min(before, frequency)
    for _ in range(_SPEED_TRIES):
        slip = frequency - speed
        ratio = slip / spec.breakdown_slip
        pull = 2.0 * spec.breakdown * ratio / (1.0 + ratio * ratio)
        stiffness = 2.0 * spec.breakdown / spec.breakdown_slip * (1.0 - ratio * ratio) / (1.0 + ratio * ratio) ** 2
        torque = load_torque(spec, speed / spec.compensation, flow, rated_flow)
        rising = (2.0 * spec.shutoff_share * speed + (1.0 - spec.shutoff_share) * max(flow, 0.0) / rated_flow) / (
            spec.compensation
        )
        left = spec.inertia_s * (speed - before) / TICK_S - pull + torque
        slope = spec.inertia_s / TICK_S + max(stiffness, 0.0) + rising
        change = left / slope
        speed = min(max(speed - change, 0.0), frequency)
        if abs(change) < 1e-10:
            break
    return speed


@inlined
def input_w(spec: ElasticSpec, i: int, frequency: float, speed: float, flow: float) -> float:
    """Electrical power: of the shaft, of slip, copper, iron and drive. [W]."""
    torque = load_torque(spec, speed / spec.compensation, flow, spec.rated_flow[i])
    shaft = torque * speed / spec.compensation
    lost = torque * (frequency - speed) + spec.copper * torque**2 + spec.iron * frequency + spec.standing
    return float(spec.rated_w[i]) * spec.power_scale * (shaft + lost)


@inlined
def head_terms(
    spec: ElasticSpec, i: int, speed: float, rags: float, ring: float, level_m: float
) -> tuple[float, float, float]:
    """Head = first + second q + third q² over a pump at a speed ratio; `ring` is what flows back inside. [m³/s]."""
    rated, vane_m = spec.rated_flow[i], spec.vane_loss[i] * spec.rated_head_m[i]
    sucked = max(1.0 - level_m / spec.suction_level_m, 0.0) ** 2 * spec.suction_m
    linear = spec.linear[i] * speed + 2.0 * spec.square[i] * ring
    first = spec.shutoff_m[i] * speed**2 + (spec.linear[i] * speed + spec.square[i] * ring) * ring
    first -= 0.5 * vane_m * speed**2
    third = spec.square[i] - (0.5 * vane_m + spec.rag_limit_m[i] * rags + sucked) / rated**2
    return first, linear, third


@inlined
def flow_against(
    first: float, linear: float, third: float, loss: float, inertia: float, before: float, head_m: float
) -> float:
    """Flow at which a pump with a pipe of its own meets a head, after a step; negative where water comes back."""
    excess_m = first - head_m + inertia * before
    b, a = linear - inertia, third - loss
    if excess_m <= 0.0:
        return excess_m / max(-b, 1e-9)
    return 2.0 * excess_m / (-b + math.sqrt(b * b - 4.0 * a * excess_m))
