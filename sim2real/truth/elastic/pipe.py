r"""An elastic main: characteristics of the equations of water hammer, friction after Colebrook.

$$\frac{\partial H}{\partial t} + \frac{a^2}{g A} \frac{\partial Q}{\partial x} = 0, \qquad
\frac{\partial Q}{\partial t} + g A \frac{\partial H}{\partial x} + \frac{f Q |Q|}{2 D A} = 0$$

are ordinary along $dx / dt = \pm a$: with B = a / (g A) and the loss R of a reach,

$$H_P = H_A + B Q_A - (B + R |Q_P|) Q_P = H_C - B Q_C + (B + R |Q_P|) Q_P$$

with the loss of the new flow, so that mains of a few metres are stable, too.

References
----------
.. [1] After E. B. Wylie, V. L. Streeter, Fluid Transients in Systems: method of characteristics.
.. [2] P. K. Swamee, A. K. Jain, Explicit equations for pipe-flow problems, J. Hydraulics Division 1976.
"""

import math
from typing import NamedTuple

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled, inlined

TICK_S = 0.05
GRAVITY = 9.81
VISCOSITY_M2_S = 1.2e-6
LAMINAR = 4000.0
"""Reynolds number up to which the friction factor is kept: the water hardly moves. [1]"""
MOST_REACHES = 120


class Pipe(NamedTuple):
    """A main in numbers of its characteristics; see `ElasticSpec`."""

    reaches: int
    impedance: float
    darcy_share: float
    reynolds: float
    rough: float


def pipe_of(
    flow: float, loss: float, *, velocity_m_s: float, wave_m_s: float, column_s2_m2: float, roughness_mm: float
) -> Pipe:
    """A main for a duty, with a wave speed that divides it into whole reaches.

    What of the loss its wall does not make is made by bends, valves and the outlet. A main whose wall would make more
    than the whole loss is wider, and as much longer.

    Parameters
    ----------
    flow, loss : float
        Duty, and what the loss is there over the square of the flow. [m³/s, s²/m⁵]
    velocity_m_s, wave_m_s : float
        Of the water at the duty, and of pressure. [m/s]
    column_s2_m2 : float
        Length over g times the section. [s²/m²]
    roughness_mm : float
        Of the wall. [mm]

    Examples
    --------
    >>> pipe = pipe_of(0.05, 4000.0, velocity_m_s=1.5, wave_m_s=800.0, column_s2_m2=250.0, roughness_mm=0.2)
    >>> pipe.reaches, round(pipe.darcy_share, 2)
    (2, 0.09)
    """
    area_m2 = flow / velocity_m_s
    while True:
        diameter_m = math.sqrt(4.0 * area_m2 / math.pi)
        reynolds = diameter_m / (area_m2 * VISCOSITY_M2_S)
        rough = roughness_mm / 1000.0 / diameter_m
        wall = friction_factor(reynolds * flow, rough) * column_s2_m2 / (2.0 * diameter_m * area_m2)
        if wall <= loss:
            break
        area_m2 *= 1.1
    length_m = column_s2_m2 * GRAVITY * area_m2
    reaches = min(max(round(length_m / (wave_m_s * TICK_S)), 1), MOST_REACHES)
    return Pipe(
        reaches=reaches,
        impedance=column_s2_m2 / (reaches * TICK_S),
        darcy_share=wall / loss,
        reynolds=reynolds,
        rough=rough,
    )


@compiled
def friction_factor(reynolds: float, rough: float) -> float:
    """Friction factor of Darcy and Weisbach by the explicit form of Colebrook's equation. [1]."""
    return 0.25 / math.log10(rough / 3.7 + 5.74 / max(reynolds, LAMINAR) ** 0.9) ** 2


@inlined
def reach_loss(loss: float, flow: float, rated: float, darcy: float, reynolds: float, rough: float) -> float:
    """Loss over q² at a flow: that of the wall follows the Reynolds number, that of fittings does not."""
    wall = friction_factor(reynolds * abs(flow), rough) / friction_factor(reynolds * rated, rough)
    return loss * (1.0 - darcy + darcy * wall)


@compiled
def carried(drop_m: float, impedance: float, loss: float) -> float:
    r"""Flow for which a head is used up: the root of $B Q + R |Q| Q = h$. [m³/s].

    Examples
    --------
    >>> carried(3.0, 2.0, 1.0), carried(-3.0, 2.0, 1.0), carried(3.0, 2.0, 0.0)
    (1.0, -1.0, 1.5)
    """
    return 2.0 * drop_m / (impedance + math.sqrt(impedance * impedance + 4.0 * loss * abs(drop_m)))


@compiled
def advance(head: Floats, flow: Floats, reaches: int, impedance: float, loss: float, outlet_m: float) -> None:
    """Move heads and flows of a main by a step, but for its inlet, towards a free outlet at a head."""
    before_m, before = head[0], flow[0]
    for n in range(1, reaches):
        forward_m, backward_m = before_m + impedance * before, head[n + 1] - impedance * flow[n + 1]
        before_m, before = head[n], flow[n]
        flow[n] = carried(0.5 * (forward_m - backward_m), impedance, loss)
        head[n] = 0.5 * (forward_m + backward_m)
    flow[reaches] = carried(before_m + impedance * before - outlet_m, impedance, loss)
    head[reaches] = outlet_m
