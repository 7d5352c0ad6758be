"""Waves in a rising main: what a pump does to the water of a long main comes back, from its end, a while later."""

import math

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled

MOST_WAVE_S = 20.0
"""Longest way there and back: 3 km of polyethylene, or 10 km of steel. [s]"""
STEPS = 3
"""Steps within a second in which the water of a main moves."""
NODES = math.ceil(0.5 * MOST_WAVE_S * STEPS) + 1
HEAD, FLOW = 0, 1
"""Rows of a main's water: (2, NODES + 1), of which the last column has what left the ends of the last reach."""


@compiled
def still_water(water: Floats, static_head_m: float) -> None:
    """Let the water of a main stand."""
    water[HEAD, :] = static_head_m
    water[FLOW, :NODES] = 0.0
    water[FLOW, NODES] = static_head_m


@compiled
def coming(water: Floats, way: float, b: float, loss_h2_m5: float, linear_flow_m3h: float) -> tuple[float, float]:
    r"""Head c that comes to the inlet of a main, and slope $b_m$ of the head there: $H = c + b_m Q$.

    Parameters
    ----------
    water : (2, nodes + 1) array
        Head and flow at each node. [m, m³/h]
    way : float
        Steps that a wave takes from end to end, 1 or more: all reaches are a step long, but for the last one.
    b : float
        Impedance a / (g A) of the main: its inertia over the time of a wave from end to end. [m/(m³/h)]
    loss_h2_m5, linear_flow_m3h : float
        k and s of the loss k Q (Q + s) of the main. [h²/m⁵, m³/h]
    """
    reaches = int(way)
    sent_m = water[HEAD, 1] - b * water[FLOW, 1]
    if reaches == 1:
        sent_m += (way - reaches) * (water[HEAD, NODES] - sent_m)
    return sent_m, b + loss_h2_m5 / reaches * (abs(water[FLOW, 1]) + linear_flow_m3h)


@compiled
def let_back_m3h(leak_m3h: float, came_m: float, steepness: float, pumped_m3h: float) -> float:
    r"""Flow back through check valves at the inlet of a main in which waves run.

    $$Q_\text{back} = K \sqrt{H / 1\,\text{m}}, \qquad H = c + b_m (Q_\text{pumped} - Q_\text{back}) \ge 0$$

    Parameters
    ----------
    leak_m3h : float
        K. [m³/h]
    came_m, steepness : float
        c and $b_m$, as `coming` has them. [m, m/(m³/h)]
    pumped_m3h : float
        Flow of the running pumps together. [m³/h]

    Examples
    --------
    >>> let_back_m3h(10.0, 2.0, 0.02, 120.0)
    20.0
    """
    slows_m3h = 0.5 * leak_m3h**2 * steepness
    head_m = max(came_m + steepness * pumped_m3h, 0.0)
    return math.sqrt(slows_m3h**2 + leak_m3h**2 * head_m) - slows_m3h


@compiled
def pass_on(
    water: Floats,
    way: float,
    b: float,
    loss_h2_m5: float,
    linear_flow_m3h: float,
    static_head_m: float,
    head_m: float,
    flow_m3h: float,
) -> None:
    r"""Move the water of a main on by a step, to a head and flow at its inlet.

    $$H_P + (b + r |Q_A|) Q_P = H_A + b\,Q_A, \qquad H_P - (b + r |Q_B|) Q_P = H_B - b\,Q_B$$

    with the nodes A and B before and behind P a step ago, and the loss r Q |Q| of a reach; the head at the outlet is
    the static one. What crosses the last reach, which is longer than a step, is interpolated in time.

    Parameters
    ----------
    water, way, b, loss_h2_m5, linear_flow_m3h
        As in `coming`; `water` is changed.
    static_head_m : float
        [m]
    head_m, flow_m3h : float
        At the inlet after the step. [m, m³/h]

    References
    ----------
    .. [1] E. B. Wylie, V. L. Streeter, Fluid Transients in Systems, 1993: method of characteristics.
    """
    reaches = int(way)
    longer, loss = way - reaches, loss_h2_m5 / reaches
    before_m, before_m3h = water[HEAD, 0], water[FLOW, 0]
    back_m = water[HEAD, reaches] - b * water[FLOW, reaches]
    for j in range(1, reaches):
        there_m = before_m + b * before_m3h
        there = b + loss * (abs(before_m3h) + linear_flow_m3h)
        here_m = water[HEAD, j + 1] - b * water[FLOW, j + 1]
        here = b + loss * (abs(water[FLOW, j + 1]) + linear_flow_m3h)
        if j == reaches - 1:
            here_m += longer * (water[HEAD, NODES] - here_m)
        before_m, before_m3h = water[HEAD, j], water[FLOW, j]
        water[FLOW, j] = (there_m - here_m) / (there + here)
        water[HEAD, j] = there_m - there * water[FLOW, j]
    there_m = before_m + b * before_m3h
    late_m = there_m + longer * (water[FLOW, NODES] - there_m)
    water[HEAD, NODES], water[FLOW, NODES] = back_m, there_m
    water[FLOW, reaches] = (late_m - static_head_m) / (b + loss * (abs(before_m3h) + linear_flow_m3h))
    water[HEAD, reaches] = static_head_m
    water[HEAD, 0], water[FLOW, 0] = head_m, flow_m3h
