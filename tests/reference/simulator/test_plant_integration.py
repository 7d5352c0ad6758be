"""The kernel against scipy.integrate.solve_ivp of equations that are written here a second time.

Two comparisons. (1) With the PLC's scan of one second written out and the frequency held over each second, the flows
are constant in each second, so that the explicit step is exact: 1e-6 m is rounding with much to spare. (2) With ramps
and switching continuous in time, the kernel differs by its scan: a level is acted on up to 1 s late, and a ramp that
is held over each second lags by 0.5 s. One switching moves the level by no more than 1.5 s of the pump's flow; with
200 m³/h on 8 m² that is 0.0104 m, and a start and a stop make 0.021 m.
"""

import functools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from wetwell.protocols.station.rising_main import RisingMain
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

AREA_M2, STATIC_M, FRICTION = 8.0, 2.0, 6e-4
START_M, STOP_M = (1.6, 1.8, 2.0), (0.5, 0.8, 1.0)
RAMP_S, NOMINAL_HZ = 10.0, 50.0


def head_m(speed, flow_m3h):
    return 36.0 * speed**2 - 0.02333 * speed * flow_m3h - 1.3333e-4 * flow_m3h**2


def pump_flow(speed, system_head_m):
    def excess(flow_m3h):
        return head_m(speed, flow_m3h) - system_head_m

    return brentq(excess, 0.0, 1e4, xtol=1e-12) if excess(0.0) > 0 else 0.0


@functools.cache
def total_flow(frequencies_hz, layout):
    """Outflow of the station, by the mains' own balance."""
    speeds = [frequency_hz / NOMINAL_HZ for frequency_hz in frequencies_hz if frequency_hz > 0]
    if layout == "common":
        top_m = max((head_m(speed, 0.0) for speed in speeds), default=0.0)
        if top_m <= STATIC_M:
            return 0.0

        def surplus(header_m):
            main_m3h = math.sqrt((header_m - STATIC_M) / FRICTION)
            return sum(pump_flow(speed, header_m) for speed in speeds) - main_m3h

        return math.sqrt((brentq(surplus, STATIC_M, top_m, xtol=1e-13) - STATIC_M) / FRICTION)
    total = 0.0
    for speed in speeds:
        if head_m(speed, 0.0) > STATIC_M:
            total += brentq(lambda q, n=speed: head_m(n, q) - STATIC_M - FRICTION * q**2, 0.0, 1e4, xtol=1e-12)
    return total


def kernel_run(station, layout, inflow_m3h, level_m, seconds):
    main = RisingMain(static_head_m=STATIC_M, friction_h2_m5=FRICTION, layout=layout)
    scenario = Scenario(
        name="steady", initial_level_m=level_m, inflow=RecordedInflow(time_s=[0.0], flow_m3h=[inflow_m3h])
    )
    return Simulation(station.model_copy(update={"rising_main": main}), scenario, seed=1).advance(seconds)


def held_run(layout, inflow_m3h, level_m, seconds):
    """A PLC that reads the level each second, and the continuous balance between two readings."""
    frequencies = [0.0, 0.0, 0.0]
    queue, order, levels, history = [], [0, 1, 2], [], []
    for _ in range(seconds):
        levels.append(level_m)
        history.append(tuple(frequencies))
        outflow_m3h = total_flow(tuple(frequencies), layout)
        measured_m = level_m
        step = solve_ivp(
            lambda _t, _y, out=outflow_m3h: [(inflow_m3h - out) / 3600.0 / AREA_M2],
            (0.0, 1.0),
            [level_m],
            rtol=1e-10,
            atol=1e-12,
        )
        level_m = step.y[0, -1]
        running = len(queue)
        if running < 3 and measured_m >= START_M[running]:
            pump = next(p for p in order if p not in queue)
            queue.append(pump)
            order = [*range(pump + 1, 3), *range(pump + 1)]
        elif running > 0 and measured_m <= STOP_M[running - 1]:
            queue.pop()
        for pump in range(3):
            step_hz = NOMINAL_HZ / RAMP_S if pump in queue else -NOMINAL_HZ / RAMP_S
            frequencies[pump] = min(max(frequencies[pump] + step_hz, 0.0), NOMINAL_HZ)
    return np.array(levels), np.array(history).T


@pytest.mark.parametrize(
    ("layout", "inflow_m3h", "level_m", "seconds", "starts"),
    [("individual", 91.0, 1.5, 900, 2), ("individual", 300.0, 1.5, 900, 2), ("common", 235.0, 1.5, 1500, 3)],
)
def test_kernel_with_held_frequencies(quiet_alpha, layout, inflow_m3h, level_m, seconds, starts):
    recording = kernel_run(quiet_alpha, layout, inflow_m3h, level_m, seconds)
    levels_m, frequencies_hz = held_run(layout, inflow_m3h, level_m, seconds)
    for pump in range(3):
        np.testing.assert_allclose(recording.columns[f"pump{pump + 1}_frequency_hz"], frequencies_hz[pump], atol=1e-9)
    assert np.sum((frequencies_hz[:, 1:] > 0) & (frequencies_hz[:, :-1] == 0)) >= starts
    np.testing.assert_allclose(recording.columns["level_m"], levels_m, rtol=0, atol=1e-6)


def test_start_run_stop_cycle_with_continuous_ramps(quiet_alpha):
    """One pump: the well fills, the pump starts at 1.6 m, draws down to 0.5 m, stops, the well fills again."""
    inflow_m3h, level_m, seconds = 91.0, 1.5, 420

    def phase(ramp_hz_s, start_hz):
        def frequency_hz(time_s, from_s):
            return min(max(start_hz + ramp_hz_s * (time_s - from_s), 0.0), NOMINAL_HZ)

        return frequency_hz

    def crossing(wanted_m):
        def event(_time_s, level):
            return level[0] - wanted_m

        event.terminal = True
        return event

    plan = [
        (phase(0.0, 0.0), crossing(START_M[0])),
        (phase(NOMINAL_HZ / RAMP_S, 0.0), crossing(STOP_M[0])),
        (phase(-NOMINAL_HZ / RAMP_S, NOMINAL_HZ), None),
    ]
    wanted_s = np.arange(seconds, dtype=float)
    expected_m = np.full(seconds, np.nan)
    from_s, switched_s = 0.0, []
    for frequency_hz, event in plan:

        def rate(time_s, _level, frequency_hz=frequency_hz, from_s=from_s):
            outflow_m3h = total_flow((frequency_hz(time_s, from_s),), "individual")
            return [(inflow_m3h - outflow_m3h) / 3600.0 / AREA_M2]

        result = solve_ivp(
            rate,
            (from_s, float(seconds)),
            [level_m],
            events=event,
            dense_output=True,
            max_step=0.5,
            rtol=1e-8,
            atol=1e-10,
        )
        inside = (wanted_s >= from_s) & (wanted_s <= result.t[-1])
        expected_m[inside] = result.sol(wanted_s[inside])[0]
        from_s, level_m = float(result.t[-1]), float(result.y[0, -1])
        switched_s.append(from_s)
    assert switched_s[0] == pytest.approx(0.1 * AREA_M2 / (inflow_m3h / 3600.0), abs=1e-6)
    assert 250 < switched_s[1] < 380

    recording = kernel_run(quiet_alpha, "individual", inflow_m3h, 1.5, seconds)
    running = np.flatnonzero(recording.columns["pump1_frequency_hz"] > 0)
    assert 0 <= running[0] - switched_s[0] <= 2
    assert abs(running[-1] - (switched_s[1] + RAMP_S)) <= 3
    difference_m = np.abs(recording.columns["level_m"] - expected_m)
    assert difference_m.max() <= 2 * 1.5 * 200.0 / 3600.0 / AREA_M2
    assert difference_m[: running[0]].max() < 1e-9
