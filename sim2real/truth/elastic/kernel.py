r"""The elastic plant in steps of a twentieth of a second.

In each step the heads of the pumps and of what comes back in the mains are one set of equations: for each main

$$\sum_i q_i(H) = Q(H), \qquad B Q + R |Q| Q = H - C$$

with $q_i(H)$ the flow of pump i through its branch against the head H of the main, and C what comes back
in it. The left side falls with H and the right side rises; Newton's method finds where they meet. Where H falls to
that of vapour the column parts: a cavity takes what leaves and does not come, until it has closed again [1].

References
----------
.. [1] After E. B. Wylie, V. L. Streeter, Fluid Transients in Systems: discrete vapour cavities.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled, inlined
from wetwell.protocols.orders import Orders, first_place, go_on, valves
from wetwell.sim2real.truth.elastic.machine import flow_against, given_frequency, head_terms, input_w, turned
from wetwell.sim2real.truth.elastic.pipe import TICK_S, advance, carried, reach_loss
from wetwell.sim2real.truth.elastic.spec import FILLET, PRISMATIC, ElasticSpec

TICKS = round(1.0 / TICK_S)
DAY_S = 86_400.0
LEVEL, READING = range(2)
COMMAND, FLOW, HEAD, POWER, METER = range(5)
_SPEED, _FREQUENCY, _RATIO, _RAGS, _OPEN, _BACK_S, _FIRST_FILTER, _ON, _TOLD_FLOW, _SET = range(5, 15)
_MACHINE_ROWS = 15
_SEEN_FIRST, _SEEN, _AIR, _REGISTER, _RUNNING, _TURN = range(6)
_HEADER_TRIES = 30
_OLDEST_S = 120
VAPOUR_M = -10.0
"""Head at the inlet of a main at which its water column parts: that of vapour, over the air at the pumps. [m]"""


class Weather(NamedTuple):
    """What acts from outside, a value at each of n whole seconds. [m³/s, 1, m, 1, 1, m].

    `inflow` has one value more, and is linear between the seconds. `loss`, `voltage` and `speed` (pumps, n) are
    factors on the mains' loss, the power and the pumps' speed.
    """

    inflow: Floats
    loss: Floats
    lift_m: Floats
    voltage: Floats
    speed: Floats
    reading_error_m: Floats


@inlined
def area_m2(spec: ElasticSpec, level_m: float) -> float:
    """Cross-section of the wet well at a level: straight, over a rounded floor, over a wedge. [m²]."""
    if spec.floor == PRISMATIC or level_m >= spec.floor_height_m:
        return spec.area_m2
    height = max(level_m, 0.0) / spec.floor_height_m
    share = math.sqrt(1.0 - (1.0 - height) ** 2) if spec.floor == FILLET else height
    return spec.area_m2 * (spec.floor_share + (1.0 - spec.floor_share) * share)


def integrate(
    spec: ElasticSpec,
    level_m: float,
    weather: Weather,
    orders: Orders,
    station: Floats,
    pumps: Floats,
    steps: Integers,
) -> None:
    """Fill the records, (2, n), (5, pumps, n) and (n,), with the state at each whole second.

    Parameters
    ----------
    spec : ElasticSpec
    level_m : float
        At the beginning. [m]
    weather : Weather
    orders : Orders
        Of an operator.
    station, pumps, steps : arrays
        Rows `LEVEL`, `READING`, and `COMMAND` to `METER`, SI units; step of the orders in force.
    """
    count, nodes = spec.main_of.size, (spec.reaches.size, int(spec.reaches.max()) + 1)
    state = State(
        pump=np.zeros((_MACHINE_ROWS, count)),
        terms=np.zeros((3, count)),
        order=np.zeros(count, dtype=np.int64),
        well=np.array([level_m, level_m, spec.air_limit_m, level_m, 0.0, 0.0]),
        head_m=np.full(nodes, spec.lift_m),
        flow=np.zeros(nodes),
        cavity_m3=np.zeros(spec.reaches.size),
        readings=np.full(_OLDEST_S, level_m),
    )
    rows: dict[str, Any] = {
        name: np.ascontiguousarray(value) for name, value in spec._asdict().items() if isinstance(value, np.ndarray)
    }
    _integrate(spec._replace(**rows), level_m, weather, orders, first_place(), state, station, pumps, steps)


class State(NamedTuple):
    """What changes from step to step, in place: rows of pumps and well as named above, nodes of the mains.

    `terms` are those of the pumps' heads over their flows, `readings` the level of the last seconds, `order` that in
    which the running pumps have started, `cavity_m3` the vapour at the inlets of the mains.
    """

    pump: Floats
    terms: Floats
    order: Integers
    well: Floats
    head_m: Floats
    flow: Floats
    cavity_m3: Floats
    readings: Floats


@compiled
def _integrate(
    spec: ElasticSpec,
    level_m: float,
    weather: Weather,
    orders: Orders,
    place: Integers,
    state: State,
    station: Floats,
    pumps: Floats,
    steps: Integers,
) -> None:
    pump, well, readings, seconds = state.pump, state.well, state.readings, weather.loss.size
    polled_s = -spec.poll_s
    step = 0
    for second in range(seconds):
        reading_m = well[_SEEN] + weather.reading_error_m[second]
        readings[second % _OLDEST_S] = reading_m
        station[LEVEL, second], station[READING, second] = level_m, reading_m
        for row in range(METER + 1):
            for i in range(pump.shape[1]):
                pumps[row, i, second] = pump[row, i]
        steps[second] = place[2]
        shut, inlet = valves(orders, place[2])
        ordered = go_on(orders, place, reading_m)
        is_by_hand = ordered >= 0 and orders.is_by_hand[ordered]
        if is_by_hand:
            _obey(orders, ordered, well, state.order, pump)
        else:
            pump[_SET] = 1.0
        for part in range(TICKS):
            now_s = step * TICK_S
            if not is_by_hand and (step - spec.scan_first) % spec.scan_steps == 0:
                if now_s - polled_s >= spec.poll_s:
                    polled_s = now_s
                    old = int(min(spec.old_s, second, _OLDEST_S - 1))
                    well[_REGISTER] = readings[(second - old) % _OLDEST_S]
                _scan(spec, well, state.order, pump)
            _drive(spec, pump, weather.speed, second, now_s)
            lift_m = spec.lift_m - spec.lift_slope * (level_m - spec.lift_reference_m) + weather.lift_m[second]
            lift_m = max(lift_m + well[_AIR], 0.0)
            out = _pump(spec, state, lift_m, shut * weather.loss[second], level_m)
            share = (part + 0.5) * TICK_S
            arriving = inlet * ((1.0 - share) * weather.inflow[second] + share * weather.inflow[second + 1])
            arriving += spec.seepage * (1.0 + spec.seepage_swing * math.sin(2.0 * math.pi * now_s / DAY_S))
            level_m = _filled(spec, level_m, arriving - out)
            _sense(spec, pump, well, level_m, out)
            step += 1
        for i in range(pump.shape[1]):
            pump[POWER, i] *= weather.voltage[second]


@inlined
def _scan(spec: ElasticSpec, well: Floats, order: Integers, pump: Floats) -> None:
    """One cycle of the PLC: starts in rotation, stops who started last."""
    running, level_m = int(well[_RUNNING]), well[_REGISTER]
    if running < spec.start_m.size and level_m >= spec.start_m[running]:
        i = int(well[_TURN])
        while pump[_ON, i] > 0.0:
            i = (i + 1) % order.size
        pump[_ON, i], order[running] = 1.0, i
        well[_RUNNING], well[_TURN] = running + 1.0, (i + 1.0) % order.size
    elif running > 0 and level_m <= spec.stop_m[running - 1]:
        well[_RUNNING] = running - 1.0
        pump[_ON, order[running - 1]] = 0.0


@inlined
def _obey(orders: Orders, ordered: int, well: Floats, order: Integers, pump: Floats) -> None:
    """Switch pumps as an operator wants it, and set their speeds."""
    count = 0
    for k in range(int(well[_RUNNING])):
        if orders.speed_ratio[ordered, order[k]] > 0.0:
            order[count] = order[k]
            count += 1
    for i in range(order.size):
        ratio = orders.speed_ratio[ordered, i]
        if ratio > 0.0 and pump[_ON, i] <= 0.0:
            order[count] = i
            count += 1
        pump[_ON, i] = 1.0 if ratio > 0.0 else 0.0
        pump[_SET, i] = ratio if ratio > 0.0 else 1.0
    well[_RUNNING] = count


@inlined
def _drive(spec: ElasticSpec, pump: Floats, speed_factor: Floats, second: int, now_s: float) -> None:
    """Ramps of the drives, and the shafts that follow them."""
    swing = 1.0 + spec.hunting * math.sin(2.0 * math.pi * now_s / spec.hunting_s)
    for i in range(pump.shape[1]):
        wanted, reach = pump[_SET, i] if pump[_ON, i] > 0.0 else 0.0, TICK_S / spec.ramp_s
        told = min(max(wanted, pump[COMMAND, i] - reach), pump[COMMAND, i] + reach)
        told = 0.0 if told < 1e-9 else told
        pump[COMMAND, i] = told
        pump[_FREQUENCY, i] = given_frequency(spec, told) * swing
        pump[_SPEED, i] = turned(spec, pump[_FREQUENCY, i], pump[_SPEED, i], pump[FLOW, i], spec.rated_flow[i])
        pump[_RATIO, i] = pump[_SPEED, i] / spec.compensation * speed_factor[i, second]
        if told > 0.0:
            pump[_RAGS, i] = min(pump[_RAGS, i] + TICK_S / spec.rag_s[i], 1.0)
        else:
            pump[_RAGS, i] = 0.0


@inlined
def _pump(spec: ElasticSpec, state: State, lift_m: float, loss_factor: float, level_m: float) -> float:
    """Move the water by a step; what leaves the wet well, less what comes back. [m³/s]."""
    inertia, out = spec.branch_inertance / TICK_S, 0.0
    branch_loss = spec.branch_loss * loss_factor
    pump, terms, head, flow = state.pump, state.terms, state.head_m, state.flow
    for i in range(pump.shape[1]):
        ring = spec.ring_leak[i] * math.sqrt(max(pump[HEAD, i], 0.0)) if pump[_RATIO, i] > 0.0 else 0.0
        terms[0, i], terms[1, i], terms[2, i] = head_terms(spec, i, pump[_RATIO, i], pump[_RAGS, i], ring, level_m)
    for m in range(spec.reaches.size):
        reaches = spec.reaches[m]
        loss = loss_factor * reach_loss(
            spec.loss[m], flow[m, 0], spec.rated_flow[0], spec.darcy_share, spec.reynolds, spec.rough
        )
        loss /= reaches
        back_m = head[m, 1] - spec.impedance[m] * flow[m, 1]
        top_m = _header_m(spec, pump, terms, m, branch_loss, inertia, head[m, 0], back_m, loss)
        top_m = _parted_m(spec, state, m, branch_loss, inertia, top_m, back_m, loss)
        for i in range(pump.shape[1]):
            if spec.main_of[i] == m:
                pump[FLOW, i] = _branch(spec, pump, terms, i, branch_loss, inertia, top_m)[0]
                out += pump[FLOW, i]
                _move_valve(spec, pump, terms, i, top_m)
        advance(head[m], flow[m], reaches, spec.impedance[m], loss, lift_m)
        head[m, 0], flow[m, 0] = top_m, carried(top_m - back_m, spec.impedance[m], loss)
    for i in range(pump.shape[1]):
        pump[HEAD, i] = 0.0
        pump[POWER, i] = 0.0
        if pump[COMMAND, i] > 0.0:
            forward = max(pump[FLOW, i], 0.0)
            pump[HEAD, i] = max(terms[0, i] + (terms[1, i] + terms[2, i] * forward) * forward, 0.0)
            pump[POWER, i] = input_w(spec, i, pump[_FREQUENCY, i], pump[_SPEED, i], forward)
    return out


@inlined
def _parted_m(
    spec: ElasticSpec,
    state: State,
    m: int,
    branch_loss: float,
    inertia: float,
    top_m: float,
    back_m: float,
    loss: float,
) -> float:
    """Head of a main at its inlet, that of vapour while there is a cavity of what left and did not come. [m]."""
    if state.cavity_m3[m] <= 0.0 and top_m >= VAPOUR_M:
        return top_m
    grown = carried(VAPOUR_M - back_m, spec.impedance[m], loss)
    for i in range(state.pump.shape[1]):
        if spec.main_of[i] == m:
            grown -= _branch(spec, state.pump, state.terms, i, branch_loss, inertia, VAPOUR_M)[0]
    state.cavity_m3[m] = max(state.cavity_m3[m] + grown * TICK_S, 0.0)
    return VAPOUR_M if state.cavity_m3[m] > 0.0 else top_m


@inlined
def _header_m(
    spec: ElasticSpec,
    pump: Floats,
    terms: Floats,
    m: int,
    branch_loss: float,
    inertia: float,
    before_m: float,
    back_m: float,
    loss: float,
) -> float:
    """Head of a main at its inlet, where flows in and out are equal: Newton's method in a bracket. [m]."""
    low_m, high_m, now_m = -1e4, 1e4, before_m
    for _ in range(_HEADER_TRIES):
        total = carried(now_m - back_m, spec.impedance[m], loss)
        excess, slope = -total, -1.0 / (spec.impedance[m] + 2.0 * loss * abs(total))
        for i in range(pump.shape[1]):
            if spec.main_of[i] == m:
                one, its_slope = _branch(spec, pump, terms, i, branch_loss, inertia, now_m)
                excess += one
                slope += its_slope
        if excess > 0.0:
            low_m = now_m
        else:
            high_m = now_m
        change_m = -excess / slope
        if abs(change_m) < 1e-9:
            break
        now_m += change_m
        if not low_m < now_m < high_m:
            now_m = 0.5 * (low_m + high_m)
    return now_m


@inlined
def _branch(
    spec: ElasticSpec, pump: Floats, terms: Floats, i: int, branch_loss: float, inertia: float, top_m: float
) -> tuple[float, float]:
    """Flow of a pump against the head of its main, and its slope: forward, leaking, or back through an open valve."""
    if pump[_OPEN, i] <= 0.0:
        if spec.valve_leak <= 0.0 or top_m <= 1e-6 or pump[COMMAND, i] > 0.0:
            return 0.0, 0.0
        root = math.sqrt(top_m)
        return -spec.valve_leak * root, -0.5 * spec.valve_leak / root
    before, linear, third = pump[FLOW, i], terms[1, i], terms[2, i]
    one = flow_against(terms[0, i], linear, third, branch_loss, inertia, before, top_m)
    if one < 0.0 and spec.valve_s <= 0.0:
        return 0.0, 0.0
    return one, 1.0 / (linear - inertia + 2.0 * (third - branch_loss) * max(one, 0.0))


@inlined
def _move_valve(spec: ElasticSpec, pump: Floats, terms: Floats, i: int, top_m: float) -> None:
    """Open a check valve under a head over the main's, shut it when water has come back for its time."""
    if pump[_OPEN, i] <= 0.0:
        if pump[_RATIO, i] > 0.0 and terms[0, i] > top_m + spec.valve_barrier_m[i]:
            pump[_OPEN, i] = 1.0
        pump[_BACK_S, i] = 0.0
        return
    pump[_BACK_S, i] = pump[_BACK_S, i] + TICK_S if pump[FLOW, i] <= 0.0 else 0.0
    if pump[_BACK_S, i] > spec.valve_s:
        pump[_OPEN, i] = 0.0
        pump[FLOW, i] = 0.0


@inlined
def _filled(spec: ElasticSpec, level_m: float, net: float) -> float:
    """Level after a step by Heun's method; the wet well spills at its crest and is not emptied below 0. [m]."""
    first = net / area_m2(spec, level_m)
    second = net / area_m2(spec, level_m + first * TICK_S)
    return min(max(level_m + 0.5 * (first + second) * TICK_S, 0.0), spec.crest_m)


@inlined
def _sense(spec: ElasticSpec, pump: Floats, well: Floats, level_m: float, out: float) -> None:
    """Filters of level and flow meters; air in the main."""
    kept = math.exp(-2.0 * TICK_S / spec.level_filter_s) if spec.level_filter_s > 0.0 else 0.0
    well[_SEEN_FIRST] = level_m + kept * (well[_SEEN_FIRST] - level_m)
    well[_SEEN] = well[_SEEN_FIRST] + kept * (well[_SEEN] - well[_SEEN_FIRST])
    kept = math.exp(-2.0 * TICK_S / spec.flow_filter_s) if spec.flow_filter_s > 0.0 else 0.0
    for i in range(pump.shape[1]):
        seen = max(pump[FLOW, i], 0.0)
        if seen < spec.flow_cutoff:
            seen = 0.0
        pump[_FIRST_FILTER, i] = seen + kept * (pump[_FIRST_FILTER, i] - seen)
        pump[METER, i] = pump[_FIRST_FILTER, i] + kept * (pump[METER, i] - pump[_FIRST_FILTER, i])
    if spec.air_limit_m > 0.0:
        if out > 0.0:
            well[_AIR] *= 1.0 - out * TICK_S / spec.air_clearing_m3
        else:
            well[_AIR] = min(well[_AIR] + spec.air_limit_m * TICK_S / spec.air_growth_s, spec.air_limit_m)
