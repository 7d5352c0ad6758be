r"""The true station in steps of a twentieth of a second.

The water in the pipes is a set of rigid columns that are always accelerated, never solved for: for pump i

$$I_o \dot q_i + I_s \sum_j \dot q_j = H_i(q_i) - H_s - K_o q_i^2 - K_s \Big(\sum_j q_j\Big)^2, \qquad q_i \ge 0$$

with each step linearised and implicit (Rosenbrock's method of first order), so that columns without inertia settle
by Newton's steps. The coupling has rank one and is solved by the formula of Sherman and Morrison.

References
----------
.. [1] After E. B. Wylie, V. L. Streeter, Fluid Transients in Systems: rigid water columns.
.. [2] After E. Hairer, G. Wanner, Solving Ordinary Differential Equations II: Rosenbrock methods.
"""

import math

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import allocating
from wetwell.protocols.orders import Orders, go_on, valves
from wetwell.sim2real.truth.spec import CONE, PRISM, Spec

STEPS = 20
STEP_S = 1.0 / STEPS
LEVEL, LEVEL_READING = range(2)
COMMAND, FLOW, HEAD, POWER, DAMPED_FLOW = range(5)
_TORQUE, _PUMPED, _SPEED, _PUSH, _STIFFNESS, _OPEN, _ON, _SET = range(5, 13)
_PUMP_ROWS = 13
_LEVEL, _SEEN, _AIR, _PRIMED, _BACK = range(5)
_READING, _RUNNING, _TURN, _OVER, _UNDER = range(5)
_PLC_ROWS = 5
_STOPPED = 1e-9


@allocating
def area_m2(spec: Spec, level_m: float) -> float:
    """Cross-section of the wet well at a level. [m²]."""
    if spec.shape == PRISM:
        return spec.area_m2
    height = level_m / spec.shape_height_m
    if spec.shape == CONE:
        narrow = math.sqrt(spec.floor_factor)
        return spec.area_m2 * (narrow + (1.0 - narrow) * min(max(height, 0.0), 1.0)) ** 2
    share = 1.0 / (1.0 + math.exp(-20.0 * (height - 1.0)))  # BENCH
    return spec.area_m2 * (spec.floor_factor + (1.0 - spec.floor_factor) * share)


@allocating
def shaft_ratio(command: float, bow: float) -> float:
    """Speed of the shaft for a command: linear, bowed to a half cosine, or to a parabola."""
    if bow >= 0.0:
        return (1.0 - bow) * command + bow * 0.5 * (1.0 - math.cos(math.pi * command))
    return (1.0 + bow) * command - bow * command * command


@allocating
def torque_ratio(speed: float, flow: float, rated_flow: float) -> float:
    """Torque over the rated one: parabola in the flow, square in the speed."""
    if speed <= 0.0:
        return 0.0
    share = flow / (speed * rated_flow)
    return speed**2 * max(0.35 + 0.9 * share - 0.25 * share**2, 0.1)


@allocating
def pipe_loss(flow: float, spec: Spec) -> tuple[float, float]:
    """Loss of a pipe of coefficient 1 and its derivative: between rough (q²) and Blasius (q^1.75)."""
    rough = flow * abs(flow)
    if spec.smoothness <= 0.0 or flow <= 0.0:
        return rough, 2.0 * abs(flow)
    smooth = spec.rated_flow**0.25 * flow**1.75
    share = spec.smoothness
    return (1.0 - share) * rough + share * smooth, 2.0 * (1.0 - share) * flow + 1.75 * share * smooth / flow


@allocating
def pump_head_m(spec: Spec, i: int, speed: float, flow: float, level_m: float) -> tuple[float, float]:
    """Head of a pump at its flange and its derivative by the flow; wear and vortex taken off."""
    inner = flow
    if spec.ring_leak[i] > 0.0:
        plain = spec.shutoff_m[i] * speed**2 - spec.linear[i] * speed * flow - spec.square[i] * flow**2
        inner += spec.ring_leak[i] * math.sqrt(max(plain, 0.0))
    head = spec.shutoff_m[i] * speed**2 - spec.linear[i] * speed * inner - spec.square[i] * inner**2
    slope = -spec.linear[i] * speed - 2.0 * spec.square[i] * inner
    sucked = max(1.0 - level_m / spec.vortex_level_m, 0.0)
    return spec.head_factor[i] * head - spec.vortex_m * (sucked * speed) ** 2, spec.head_factor[i] * slope


@allocating
def integrate(
    spec: Spec,
    level_m: float,
    inflow: Floats,
    loss_factor: Floats,
    extra_lift_m: Floats,
    voltage_factor: Floats,
    speed_factor: Floats,
    level_error_m: Floats,
    is_level_stuck: Floats,
    orders: Orders,
    place: Integers,
    station_record: Floats,
    pump_record: Floats,
    step_record: Integers,
) -> None:
    """Fill the records, (2, n), (5, pumps, n) and (n,), with the state at the beginning of each second.

    The PLC reads, decides and commands once a second, or an operator by his orders; all else moves in steps of
    `STEP_S`.
    """
    pumps = spec.shutoff_m.size
    pump = np.zeros((_PUMP_ROWS, pumps))
    well = np.array([level_m, level_m, spec.air_seed_m, 0.0, 0.0])
    plc = np.zeros(_PLC_ROWS)
    order = np.zeros(pumps, dtype=np.int64)
    for second in range(loss_factor.size):
        if is_level_stuck[second] <= 0.0 or second == 0:
            plc[_READING] = well[_SEEN] + level_error_m[second]
        station_record[LEVEL, second] = well[_LEVEL]
        station_record[LEVEL_READING, second] = plc[_READING]
        pump_record[:, :, second] = pump[: DAMPED_FLOW + 1]
        step_record[second] = place[2]
        shut, inlet = valves(orders, place[2])
        ordered = go_on(orders, place, plc[_READING])
        if ordered >= 0 and orders.is_by_hand[ordered]:
            _obey(orders.speed_ratio[ordered], plc, order, pump)
        else:
            pump[_SET] = 1.0
            _decide(spec, plc, order, pump)
        swing = 1.0 + spec.hunting * math.sin(2.0 * math.pi * second / spec.hunting_s)
        for step in range(STEPS):
            _turn(spec, pump, swing, speed_factor[:, second])
            out, back = _move(spec, pump, well, shut * loss_factor[second], extra_lift_m[second])
            now = inflow[second] + (inflow[second + 1] - inflow[second]) * (step + 0.5) * STEP_S
            _fill(spec, well, inlet * now + spec.hidden_inflow + back - out, out)
        _load(spec, pump, well[_LEVEL], voltage_factor[second])


@allocating
def _decide(spec: Spec, plc: Floats, order: Integers, pump: Floats) -> None:
    """One scan of the PLC: at most one start, in rotation, or one stop, of the pump that started last."""
    running, levels, pumps = int(plc[_RUNNING]), spec.start_m.size, order.size
    is_over = running < levels and plc[_READING] >= spec.start_m[min(running, levels - 1)]
    is_under = running > 0 and plc[_READING] <= spec.stop_m[max(running - 1, 0)]
    plc[_OVER] = plc[_OVER] + 1.0 if is_over else 0.0
    plc[_UNDER] = plc[_UNDER] + 1.0 if is_under else 0.0
    if is_over and plc[_OVER] > spec.timer_s:
        plc[_OVER] = 0.0
        for k in range(pumps):
            i = (int(plc[_TURN]) + k) % pumps
            if pump[_ON, i] <= 0.0:
                pump[_ON, i] = 1.0
                order[running] = i
                plc[_RUNNING] += 1.0
                plc[_TURN] = (i + 1) % pumps
                return
    elif is_under and plc[_UNDER] > spec.timer_s:
        plc[_UNDER] = 0.0
        plc[_RUNNING] -= 1.0
        pump[_ON, order[running - 1]] = 0.0


@allocating
def _obey(speed_ratio: Floats, plc: Floats, order: Integers, pump: Floats) -> None:
    """Pumps run as an operator wants it; who still runs keeps its place in the order of the starts."""
    running, before = 0, int(plc[_RUNNING])
    for k in range(before):
        if speed_ratio[order[k]] > 0.0:
            order[running] = order[k]
            running += 1
    for i in range(speed_ratio.size):
        if speed_ratio[i] > 0.0:
            pump[_SET, i] = speed_ratio[i]
            if pump[_ON, i] <= 0.0:
                order[running] = i
                running += 1
        pump[_ON, i] = 1.0 if speed_ratio[i] > 0.0 else 0.0
    plc[_RUNNING], plc[_OVER], plc[_UNDER] = running, 0.0, 0.0


@allocating
def _turn(spec: Spec, pump: Floats, swing: float, speed_factor: Floats) -> None:
    """Move the commands by a step, and with them the speeds that the water sees."""
    for i in range(pump.shape[1]):
        wanted = pump[_SET, i] if pump[_ON, i] > 0.0 else 0.0
        reach = STEP_S / spec.ramp_s
        command = min(max(wanted, pump[COMMAND, i] - reach), pump[COMMAND, i] + reach)
        if command < _STOPPED:
            command = 0.0
            pump[_PUMPED, i] = 0.0
        pump[COMMAND, i] = command
        rag = spec.rag_limit[i] * pump[_PUMPED, i] / (pump[_PUMPED, i] + spec.rag_half_m3[i])
        slip = spec.slip * (pump[_TORQUE, i] + 0.2 * pump[_TORQUE, i] ** 2) / 1.2
        pump[_SPEED, i] = shaft_ratio(command, spec.ramp_bow) * swing * (1.0 - slip) * (1.0 - rag) * speed_factor[i]


@allocating
def _move(spec: Spec, pump: Floats, well: Floats, loss_factor: float, extra_lift_m: float) -> tuple[float, float]:
    """Move the water by a step; mean flow out of the wet well and flow back into it. [m³/s]."""
    pumps = pump.shape[1]
    lift_m = spec.lift_m - spec.lift_slope * (well[_LEVEL] - spec.lift_reference_m) + well[_AIR] + extra_lift_m
    if well[_PRIMED] >= spec.siphon_prime_s:
        lift_m -= spec.siphon_m
    lift_m = max(lift_m, 0.0)
    shared_m, shared_slope = pipe_loss(pump[FLOW].sum() - well[_BACK], spec)  # of the step before
    shared_m *= spec.shared_loss * loss_factor
    coupling = spec.shared_inertance / STEP_S + spec.shared_loss * loss_factor * shared_slope
    weighted, compliance = 0.0, 0.0
    for i in range(pumps):
        lifted_m, slope = pump_head_m(spec, i, pump[_SPEED, i], pump[FLOW, i], well[_LEVEL])
        own_m, own_slope = pipe_loss(pump[FLOW, i], spec)
        loss = spec.own_loss * loss_factor
        push_m = lifted_m - lift_m - loss * own_m - shared_m
        barrier_m = 0.0 if pump[_OPEN, i] > 0.0 else spec.flap_opening_m[i]
        is_open = pump[FLOW, i] > 0.0 or push_m > barrier_m
        pump[_OPEN, i] = 1.0 if is_open else 0.0
        pump[_PUSH, i] = push_m
        if is_open:
            pump[_STIFFNESS, i] = spec.own_inertance / STEP_S - slope + loss * own_slope
            weighted += push_m / pump[_STIFFNESS, i]
            compliance += 1.0 / pump[_STIFFNESS, i]
    total_change = weighted / (1.0 + coupling * compliance)
    out, back = 0.0, 0.0
    followed = 1.0 if spec.flow_lag_s <= 0.0 else 1.0 - math.exp(-STEP_S / spec.flow_lag_s)
    for i in range(pumps):
        before = pump[FLOW, i]
        if pump[_OPEN, i] > 0.0:
            change = (pump[_PUSH, i] - coupling * total_change) / pump[_STIFFNESS, i]
            pump[FLOW, i] = max(before + change, 0.0)
        elif pump[COMMAND, i] <= 0.0:
            back += spec.flap_leak * math.sqrt(max(lift_m + shared_m, 0.0))
        out += 0.5 * (before + pump[FLOW, i])
        pump[_PUMPED, i] += pump[FLOW, i] * STEP_S
        pump[DAMPED_FLOW, i] += (pump[FLOW, i] - pump[DAMPED_FLOW, i]) * followed
        pump[_TORQUE, i] = torque_ratio(pump[_SPEED, i], pump[FLOW, i], spec.rated_flow)
    well[_BACK] = back if spec.shared_loss > 0.0 else 0.0
    return out, back


@allocating
def _fill(spec: Spec, well: Floats, net: float, out: float) -> None:
    """Move level, its sensor, air and siphon by a step under a net inflow and the flow pumped out. [m³/s]."""
    level_m = well[_LEVEL] + net * STEP_S / area_m2(spec, well[_LEVEL])
    well[_LEVEL] = min(max(level_m, 0.0), spec.crest_m)
    followed = 1.0 if spec.level_lag_s <= 0.0 else 1.0 - math.exp(-STEP_S / spec.level_lag_s)
    well[_SEEN] += (well[_LEVEL] - well[_SEEN]) * followed
    if spec.air_limit_m > 0.0:
        air_m = well[_AIR]
        if out > 0.0:
            air_m -= air_m * out * STEP_S / spec.air_purge_m3
        else:
            air_m += spec.air_rate * air_m * (1.0 - air_m / spec.air_limit_m) * STEP_S
        well[_AIR] = max(air_m, spec.air_seed_m)
    well[_PRIMED] = well[_PRIMED] + STEP_S if out > spec.siphon_flow else 0.0


@allocating
def _load(spec: Spec, pump: Floats, level_m: float, voltage_factor: float) -> None:
    """Head over each pump and power that it takes; a pump without a command shows none."""
    for i in range(pump.shape[1]):
        pump[HEAD, i] = 0.0
        pump[POWER, i] = 0.0
        command = pump[COMMAND, i]
        if command > 0.0:
            pump[HEAD, i] = max(pump_head_m(spec, i, pump[_SPEED, i], pump[FLOW, i], level_m)[0], 0.0)
            load = spec.rated_factor * (0.04 + 0.06 * pump[_TORQUE, i] ** 2 + 0.9 * pump[_TORQUE, i] * command)
            share = (1.0 - spec.load_share) * command + spec.load_share * load
            pump[POWER, i] = spec.rated_power_w * share * voltage_factor
