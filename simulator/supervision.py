"""The PLC at work: it starts and stops pumps, sets their speed, and moves their drives, second by second.

The rules are those of `control` and `drive`; here they act on the arrays of `layout`.
"""

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled
from wetwell.simulator import layout as at
from wetwell.simulator.control import (
    NOTHING,
    SECONDS_PER_HOUR,
    controlled_frequency_hz,
    next_in_rotation,
    wanted_change,
)
from wetwell.simulator.drive import next_frequency_hz


@compiled
def supervise(
    station: Floats,
    pump: Floats,
    levels: Floats,
    station_state: Floats,
    pump_state: Floats,
    pump_force: Floats,
    second: int,
    started: Integers,
    recent_starts: Integers,
    counters: Integers,
    level_m: float,
) -> None:
    """Let the controller command at most one start or stop; pumps that are off or tripped are released first."""
    running = 0
    for k in range(counters[at.RUNNING]):
        i = started[k]
        if pump[at.IS_AUTOMATIC, i] > 0.0 and pump_force[at.IS_TRIPPED, i, second] <= 0.0:
            started[running] = i
            running += 1
        else:
            pump_state[at.IS_COMMANDED, i] = 0.0
            pump_state[at.DWELL_LEFT, i] = station[at.DWELL]
    change = wanted_change(level_m, running, levels[at.START_LEVEL], levels[at.STOP_LEVEL])
    if change > 0:
        i = _next_pump(station, pump, pump_state, pump_force, second, recent_starts, counters)
        if i != NOTHING:
            pump_state[at.IS_COMMANDED, i] = 1.0
            started[running] = i
            running += 1
            counters[at.TURN] = (i + 1) % pump.shape[1]
    elif change < 0:
        running -= 1
        pump_state[at.IS_COMMANDED, started[running]] = 0.0
        pump_state[at.DWELL_LEFT, started[running]] = station[at.DWELL]
    counters[at.RUNNING] = running
    if station[at.IS_PID] > 0.0:
        _control_level(station, pump, station_state, running, started, level_m)


@compiled
def _next_pump(
    station: Floats,
    pump: Floats,
    pump_state: Floats,
    pump_force: Floats,
    second: int,
    recent_starts: Integers,
    counters: Integers,
) -> int:
    """Pump that starts next, its start noted; -1 if none may."""
    pumps = pump.shape[1]
    limit = int(station[at.STARTS_PER_HOUR])
    for i in range(pumps):
        pump_state[at.IS_READY, i] = (
            pump[at.IS_AUTOMATIC, i] > 0.0
            and pump_force[at.IS_TRIPPED, i, second] <= 0.0
            and pump_state[at.IS_COMMANDED, i] <= 0.0
            and (limit == 0 or counters[at.SECOND] - recent_starts[i, limit - 1] >= SECONDS_PER_HOUR)
        )
    chosen = next_in_rotation(
        int(station[at.ROTATION]), counters[at.TURN], pump_state[at.RUN_TIME], pump_state[at.IS_READY]
    )
    if chosen != NOTHING:
        for k in range(recent_starts.shape[1] - 1, 0, -1):
            recent_starts[chosen, k] = recent_starts[chosen, k - 1]
        recent_starts[chosen, 0] = counters[at.SECOND]
    return chosen


@compiled
def _control_level(
    station: Floats, pump: Floats, station_state: Floats, running: int, started: Integers, level_m: float
) -> None:
    """Set the frequency that commanded pumps go to; the controller rests while no pump is commanded."""
    if running == 0:
        station_state[at.PID_SUM] = 0.0
        station_state[at.PID_HAS_LAST] = 0.0
        return
    station_state[at.WANTED_FREQUENCY] = controlled_frequency_hz(
        level_m,
        station[at.PID_LEVEL],
        station[at.PID_GAIN],
        station[at.PID_INTEGRAL],
        station[at.PID_DERIVATIVE],
        station[at.MIN_FREQUENCY],
        pump[at.NOMINAL_FREQUENCY, started[0]],
        station_state[at.PID_SUM : at.PID_HAS_LAST + 1],
    )


@compiled
def drive(
    station: Floats, pump: Floats, pump_state: Floats, pump_force: Floats, second: int, wanted_hz: float
) -> None:
    """Move each drive on by a second; a tripped drive loses its pump at once."""
    for i in range(pump.shape[1]):
        frequency_hz = pump_state[at.FREQUENCY_NOW, i]
        is_commanded = pump_state[at.IS_COMMANDED, i] > 0.0
        if frequency_hz <= 0.0 and not is_commanded:
            continue
        if frequency_hz > 0.0:
            pump_state[at.RUN_TIME, i] += 1.0
        if pump_force[at.IS_TRIPPED, i, second] > 0.0:
            pump_state[at.FREQUENCY_NOW, i] = 0.0
            continue
        nominal_hz = pump[at.NOMINAL_FREQUENCY, i]
        pump_state[at.FREQUENCY_NOW, i] = next_frequency_hz(
            frequency_hz,
            is_commanded,
            nominal_hz / station[at.RAMP],
            station[at.MIN_FREQUENCY],
            min(wanted_hz, nominal_hz),
            pump_state[at.DWELL_LEFT, i],
        )
        if not is_commanded and pump_state[at.FREQUENCY_NOW, i] <= station[at.MIN_FREQUENCY]:
            pump_state[at.DWELL_LEFT, i] -= 1.0
