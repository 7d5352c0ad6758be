"""Duty points: where pump curves meet the system curve, alone or on a common header."""

import math

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled

FLOW_TOLERANCE_M3H = 1e-10
MAX_ITERATIONS = 200


@compiled
def pump_head_m(c0: float, c1: float, c2: float, speed_ratio: float, flow_m3h: float) -> float:
    r"""Head of a centrifugal pump at a given flow and speed.

    $$H(Q, N) = c_0 N^2 + c_1 N Q + c_2 Q^2, \qquad N = f / f_n$$

    The affinity laws in closed form: H scales with N² where Q scales with N. May be negative past run-out.

    Parameters
    ----------
    c0, c1, c2 : float
        Curve at nominal speed. [m, m/(m³/h), m/(m³/h)²]
    speed_ratio : float
        N, speed over nominal speed. [1]
    flow_m3h : float
        Volume flow through the pump. [m³/h]

    Returns
    -------
    head_m : float
        [m]

    References
    ----------
    .. [1] J. F. Gülich, Centrifugal Pumps, Springer: similarity laws.

    Examples
    --------
    >>> pump_head_m(20.0, 0.0, -0.001, 1.0, 100.0)
    10.0
    >>> pump_head_m(20.0, 0.0, -0.001, 0.5, 50.0)
    2.5
    """
    return c0 * speed_ratio**2 + c1 * speed_ratio * flow_m3h + c2 * flow_m3h**2


@compiled
def flow_at_head_m3h(
    c0: float,
    c1: float,
    c2: float,
    speed_ratio: float,
    head_m: float,
    inertia_m_m3h: float = 0.0,
    loss_m_m3h: float = 0.0,
) -> float:
    r"""Flow at which a pump makes a given head; zero behind a closed check valve.

    The positive root of $c_2 Q^2 + (c_1 N - j - l) Q + c_0 N^2 - H = 0$ in the form that loses no digits,

    $$Q = \frac{2 \ell}{b + \sqrt{b^2 + 4 a \ell}}, \qquad \ell = c_0 N^2 - H,\ a = -c_2,\ b = j + l - c_1 N$$

    With c2 − k for c2, k s for l and the static head for H this is the duty point against H_s + k Q (Q + s).

    Parameters
    ----------
    c0, c1, c2 : float
        Falling curve: c1 <= 0, c2 <= 0, not both zero. [m, m/(m³/h), m/(m³/h)²]
    speed_ratio : float
        N, speed over nominal speed, >= 0. [1]
    head_m : float
        Head against which the pump works. [m]
    inertia_m_m3h : float
        j, see `individual_flow_m3h`. [m/(m³/h)]
    loss_m_m3h : float
        l, head lost in proportion to the flow on the way. [m/(m³/h)]

    Returns
    -------
    flow_m3h : float
        Zero where the head reaches the shut-off head c0 N². [m³/h]

    Examples
    --------
    >>> flow_at_head_m3h(20.0, 0.0, -0.001, 1.0, 10.0)
    100.0
    >>> flow_at_head_m3h(20.0, 0.0, -0.001, 0.5, 10.0)
    0.0
    """
    lift_m = c0 * speed_ratio**2 - head_m
    if lift_m <= 0.0 or (speed_ratio <= 0.0 and inertia_m_m3h <= 0.0):
        return 0.0
    b = inertia_m_m3h + loss_m_m3h - c1 * speed_ratio
    divisor = b + math.sqrt(b * b - 4.0 * c2 * lift_m)
    return 2.0 * lift_m / divisor if divisor > 0.0 else 0.0  # 0 / 0 where the lift underflows


@compiled
def individual_flow_m3h(
    curve: Floats,
    speed_ratio: float,
    static_head_m: float,
    friction_h2_m5: float,
    linear_flow_m3h: float,
    inertia_m_m3h: float,
    before_m3h: float,
) -> float:
    r"""Duty flow of a pump against a pipe of its own.

    With inertia the column of water has to be accelerated; one implicit step of

    $$j\,(Q - Q_\text{before}) = H_\text{pump}(Q) - H_s - k Q (Q + s), \qquad Q \ge 0$$

    is again a quadratic equation, so that a step of any length is stable. With j = 0 it is the duty point.

    Parameters
    ----------
    curve : (3,) array
        c0, c1, c2. [m, m/(m³/h), m/(m³/h)²]
    speed_ratio : float
        [1]
    static_head_m, friction_h2_m5, linear_flow_m3h : float
        System curve H = H_s + k Q (Q + s). [m, h²/m⁵, m³/h]
    inertia_m_m3h : float
        j: head that changes the flow by 1 m³/h within the step. [m/(m³/h)]
    before_m3h : float
        Flow before the step. [m³/h]

    Returns
    -------
    flow_m3h : float
        Flow after the step. [m³/h]
    """
    return flow_at_head_m3h(
        curve[0],
        curve[1],
        curve[2] - friction_h2_m5,
        speed_ratio,
        static_head_m - inertia_m_m3h * before_m3h,
        inertia_m_m3h,
        friction_h2_m5 * linear_flow_m3h,
    )


@compiled
def common_flows(
    pumps: Integers,
    curves: Floats,
    speed_ratio: Floats,
    static_head_m: float,
    own_h2_m5: float,
    shared_h2_m5: float,
    linear_flow_m3h: float,
    inertia_m_m3h: float,
    leak_m3h: float,
    back_before_m3h: float,
    flow_m3h: Floats,
) -> float:
    r"""Duty flows of pumps on one header, at any speeds.

    The flow Q of the main solves

    $$\sum_i Q_i(H) - K \sqrt{H / 1\,\text{m}} = Q, \qquad H = H_s + k Q (|Q| + s) + j\,(Q - Q_\text{before})$$

    and each pump loses $k_\text{own} Q_i (Q_i + s)$ on its own way to the header. K is of the check valves through
    which water runs back: what they let through is missing in the main.

    The left side falls and the right side rises with Q, so that there is one root; Newton's method finds it, kept
    inside a bracket by bisection. One running pump without a leak is solved in closed form. A pump whose shut-off
    head lies under the header's head gives no flow: its check valve is closed.

    Parameters
    ----------
    pumps : (n,) array
        Places of the pumps that share the header; all others are left as they are.
    curves : (pumps, 3) array
        c0, c1, c2 of each pump. [m, m/(m³/h), m/(m³/h)²]
    speed_ratio : (pumps,) array
        [1]
    static_head_m, linear_flow_m3h, inertia_m_m3h : float
        As in `individual_flow_m3h`; inertia acts on the total flow.
    own_h2_m5, shared_h2_m5 : float
        Friction of each pump's own pipe, and of the one that all share. [h²/m⁵]
    leak_m3h : float
        K, flow back through the check valves of all standing pumps at a head of 1 m. [m³/h]
    back_before_m3h : float
        What ran back before the step. [m³/h]
    flow_m3h : (pumps,) array
        Flows before the step, replaced by those after it. [m³/h]

    Returns
    -------
    back_m3h : float
        What runs back after the step. [m³/h]
    """
    before_m3h = -back_before_m3h
    running = 0
    alone = 0
    for i in pumps:
        before_m3h += flow_m3h[i]
        if speed_ratio[i] > 0.0 or flow_m3h[i] > 0.0:
            running += 1
            alone = i
        else:
            flow_m3h[i] = 0.0
    if running == 0:
        return back_before_m3h
    if running == 1 and (leak_m3h <= 0.0 or speed_ratio[alone] <= 0.0):
        flow_m3h[alone] = flow_at_head_m3h(
            curves[alone, 0],
            curves[alone, 1],
            curves[alone, 2] - own_h2_m5 - shared_h2_m5,
            speed_ratio[alone],
            static_head_m - inertia_m_m3h * before_m3h,
            inertia_m_m3h,
            (own_h2_m5 + shared_h2_m5) * linear_flow_m3h,
        )
        return 0.0
    own_loss_m_m3h = own_h2_m5 * linear_flow_m3h
    rise_m_m3h = inertia_m_m3h + shared_h2_m5 * linear_flow_m3h
    lowest_head_m = static_head_m - inertia_m_m3h * before_m3h
    low_m3h = -_back_at_head(leak_m3h, lowest_head_m)[0]
    high_m3h = _flows_at_head(pumps, curves, speed_ratio, lowest_head_m, own_h2_m5, own_loss_m_m3h, flow_m3h)[0]
    total_m3h = high_m3h / (1.0 + running)
    if inertia_m_m3h > 0.0 and before_m3h < high_m3h:
        total_m3h = before_m3h  # it can hardly have moved
    back_m3h = 0.0
    for _ in range(MAX_ITERATIONS):
        head_m = lowest_head_m + (rise_m_m3h + shared_h2_m5 * abs(total_m3h)) * total_m3h
        pumped_m3h, steepness = _flows_at_head(
            pumps, curves, speed_ratio, head_m, own_h2_m5, own_loss_m_m3h, flow_m3h
        )
        back_m3h, slope = _back_at_head(leak_m3h, head_m)
        excess_m3h = pumped_m3h - back_m3h - total_m3h
        if excess_m3h > 0.0:
            low_m3h = total_m3h
        else:
            high_m3h = total_m3h
        if abs(excess_m3h) <= FLOW_TOLERANCE_M3H or high_m3h - low_m3h <= FLOW_TOLERANCE_M3H:
            break
        total_m3h -= excess_m3h / ((steepness - slope) * (rise_m_m3h + 2.0 * shared_h2_m5 * abs(total_m3h)) - 1.0)
        if not low_m3h < total_m3h < high_m3h:
            total_m3h = 0.5 * (low_m3h + high_m3h)
    return back_m3h


@compiled
def header_back_flow_m3h(
    leak_m3h: float, static_head_m: float, shared_h2_m5: float, linear_flow_m3h: float, pumped_m3h: float
) -> float:
    r"""Flow back through check valves of standing pumps on a header.

    $$Q_\text{back} = K \sqrt{H / 1\,\text{m}}, \qquad H = H_s + k Q (|Q| + s), \qquad
    Q = Q_\text{pumped} - Q_\text{back}$$

    Parameters
    ----------
    leak_m3h, static_head_m, shared_h2_m5, linear_flow_m3h : float
        K, H_s, k and s, as in `common_flows`.
    pumped_m3h : float
        Flow of the running pumps together. [m³/h]

    Examples
    --------
    >>> header_back_flow_m3h(10.0, 4.0, 0.0, 0.0, 100.0)
    20.0
    """
    low_m3h = 0.0
    high_m3h = leak_m3h * math.sqrt(static_head_m + shared_h2_m5 * pumped_m3h * (pumped_m3h + linear_flow_m3h))
    back_m3h = high_m3h
    for _ in range(MAX_ITERATIONS):
        main_m3h = pumped_m3h - back_m3h
        head_m = static_head_m + shared_h2_m5 * main_m3h * (abs(main_m3h) + linear_flow_m3h)
        through_m3h, slope = _back_at_head(leak_m3h, head_m)
        excess_m3h = back_m3h - through_m3h
        if excess_m3h > 0.0:
            high_m3h = back_m3h
        else:
            low_m3h = back_m3h
        if abs(excess_m3h) <= FLOW_TOLERANCE_M3H or high_m3h - low_m3h <= FLOW_TOLERANCE_M3H:
            break
        fall_m_m3h = shared_h2_m5 * (2.0 * abs(main_m3h) + linear_flow_m3h)
        back_m3h -= excess_m3h / (1.0 + slope * fall_m_m3h)
        if not low_m3h < back_m3h < high_m3h:
            back_m3h = 0.5 * (low_m3h + high_m3h)
    return back_m3h


@compiled
def main_flows(
    pumps: Integers,
    curves: Floats,
    speed_ratio: Floats,
    static_head_m: Floats,
    own_h2_m5: float,
    shared_h2_m5: float,
    linear_flow_m3h: float,
    is_common: bool,
    leak_m3h: Floats,
    flow_m3h: Floats,
) -> None:
    """Set the (n, pumps) duty flows of pumps of a main at n points, without inertia.

    Parameters
    ----------
    pumps : (m,) array
        Places of the pumps that the main has; all others are left as they are.
    curves : (pumps, 3) array
        c0, c1, c2 of each pump. [m, m/(m³/h), m/(m³/h)²]
    speed_ratio, static_head_m : (n, pumps) and (n,) arrays
        At each point. [1, m]
    own_h2_m5, shared_h2_m5, linear_flow_m3h : float
        As in `common_flows`. [h²/m⁵, m³/h]
    is_common : bool
        Whether pumps share the main, or have a pipe each that loses as much as both parts together.
    leak_m3h : (pumps,) array
        Flow back through the check valve of each while it stands, at a head of 1 m. [m³/h]
    flow_m3h : (n, pumps) array
        Out. [m³/h]
    """
    for point in range(static_head_m.size):
        speed, lift_m, flow = speed_ratio[point], static_head_m[point], flow_m3h[point]
        if is_common:
            back_m3h = 0.0
            for i in pumps:
                if speed[i] <= 0.0:
                    back_m3h += leak_m3h[i]
            common_flows(
                pumps, curves, speed, lift_m, own_h2_m5, shared_h2_m5, linear_flow_m3h, 0.0, back_m3h, 0.0, flow
            )
            continue
        for i in pumps:
            friction_h2_m5 = own_h2_m5 + shared_h2_m5
            flow[i] = individual_flow_m3h(curves[i], speed[i], lift_m, friction_h2_m5, linear_flow_m3h, 0.0, 0.0)


@compiled
def _back_at_head(leak_m3h: float, head_m: float) -> tuple[float, float]:
    """Flow back through check valves under a head, and its slope over the head."""
    if leak_m3h <= 0.0 or head_m <= 0.0:
        return 0.0, 0.0
    back_m3h = leak_m3h * math.sqrt(head_m)
    return back_m3h, 0.5 * back_m3h / head_m


@compiled
def _flows_at_head(
    pumps: Integers,
    curves: Floats,
    speed_ratio: Floats,
    head_m: float,
    own_h2_m5: float,
    own_loss_m_m3h: float,
    flow_m3h: Floats,
) -> tuple[float, float]:
    """Set the flow of each pump at the header's head; sum of the flows and of their slopes over the head."""
    total_m3h = 0.0
    steepness = 0.0
    for i in pumps:
        c1, c2 = curves[i, 1], curves[i, 2] - own_h2_m5
        flow_m3h[i] = flow_at_head_m3h(curves[i, 0], c1, c2, speed_ratio[i], head_m, 0.0, own_loss_m_m3h)
        if flow_m3h[i] > 0.0:
            total_m3h += flow_m3h[i]
            steepness += 1.0 / (c1 * speed_ratio[i] - own_loss_m_m3h + 2.0 * c2 * flow_m3h[i])
    return total_m3h, steepness
