"""The PLC at work: it starts and stops pumps, sets their speed, and moves their drives, second by second.

The rules are those of `rules` and `drive`; here they act on the state of the plant.
"""

from wetwell.protocols.jit import inlined
from wetwell.protocols.orders import Orders
from wetwell.simulator.control.drive import next_frequency_hz
from wetwell.simulator.control.rules import NOTHING, controlled_frequency_hz, next_in_rotation, wanted_change
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.parameters import PlantRecords
from wetwell.simulator.state import PlantState
from wetwell.simulator.wet_well import SECONDS_PER_HOUR


@inlined
def supervise(
    plant: PlantRecords, state: PlantState, forcing: Forcing, orders: Orders, step: int, second: int, level_m: float
) -> None:
    """Let the controller command at most one start or stop; pumps that are off or tripped are released first.

    While a step of the orders is by hand, the operator commands instead.
    """
    if step >= 0 and orders.is_by_hand[step]:
        _obey(plant, state, forcing, orders, step, second)
        return
    station, now, pumps, started = plant.station[0], state.station[0], state.pumps, state.started
    running = 0
    for k in range(now.running):
        i = started[k]
        if plant.pumps[i].is_automatic and not forcing.is_tripped[i, second]:
            started[running] = i
            running += 1
        else:
            pumps[i].is_commanded = False
            pumps[i].dwell_left_s = station.dwell_s
    change = wanted_change(level_m, running, plant.start_levels_m, plant.stop_levels_m)
    if change > 0:
        i = _next_pump(plant, state, forcing, second)
        if i != NOTHING:
            pumps[i].is_commanded = True
            started[running] = i
            running += 1
            now.turn = (i + 1) % pumps.size
    elif change < 0:
        running -= 1
        pumps[started[running]].is_commanded = False
        pumps[started[running]].dwell_left_s = station.dwell_s
    now.running = running
    if station.is_pid:
        _control_level(plant, state, level_m)


@inlined
def _obey(plant: PlantRecords, state: PlantState, forcing: Forcing, orders: Orders, step: int, second: int) -> None:
    """Command those pumps that a step wants to run, and release all others."""
    now, pumps, started = state.station[0], state.pumps, state.started
    running = 0
    for k in range(now.running):
        i = started[k]
        if orders.speed_ratio[step, i] > 0.0 and not forcing.is_tripped[i, second]:
            started[running] = i
            running += 1
        else:
            pumps[i].is_commanded = False
            pumps[i].dwell_left_s = plant.station[0].dwell_s
    for i in range(pumps.size):
        if orders.speed_ratio[step, i] > 0.0 and not pumps[i].is_commanded and not forcing.is_tripped[i, second]:
            pumps[i].is_commanded = True
            started[running] = i
            running += 1
            _note_start(state, i)
    now.running = running


@inlined
def _note_start(state: PlantState, i: int) -> None:
    """Note that a pump starts now."""
    for k in range(state.recent_starts.shape[1] - 1, 0, -1):
        state.recent_starts[i, k] = state.recent_starts[i, k - 1]
    state.recent_starts[i, 0] = state.station[0].second


@inlined
def _next_pump(plant: PlantRecords, state: PlantState, forcing: Forcing, second: int) -> int:
    """Pump that starts next, its start noted; -1 if none may."""
    limit, now_s, starts = plant.station[0].starts_per_hour, state.station[0].second, state.recent_starts
    for i in range(state.pumps.size):
        state.pumps[i].is_ready = (
            plant.pumps[i].is_automatic
            and not forcing.is_tripped[i, second]
            and not state.pumps[i].is_commanded
            and (limit == 0 or now_s - starts[i, limit - 1] >= SECONDS_PER_HOUR)
        )
    chosen = next_in_rotation(plant.station[0].rotation, state.station[0].turn, state.pumps)
    if chosen != NOTHING:
        _note_start(state, chosen)
    return chosen


@inlined
def _control_level(plant: PlantRecords, state: PlantState, level_m: float) -> None:
    """Set the frequency that commanded pumps go to; the controller rests while no pump is commanded."""
    station, now = plant.station[0], state.station[0]
    if now.running == 0:
        now.pid_integral_hz = 0.0
        now.has_pid_level = False
        return
    now.wanted_frequency_hz = controlled_frequency_hz(
        level_m,
        station.pid_level_m,
        station.pid_gain_hz_m,
        station.pid_integral_s,
        station.pid_derivative_s,
        station.min_frequency_hz,
        plant.pumps[state.started[0]].nominal_frequency_hz,
        now,
    )


@inlined
def drive(plant: PlantRecords, state: PlantState, forcing: Forcing, orders: Orders, second: int) -> None:
    """Move each drive on by a second; a tripped drive loses its pump at once."""
    station, step = plant.station[0], state.place[2]
    is_by_hand = step >= 0 and orders.is_by_hand[step]
    for i in range(state.pumps.size):
        pump = state.pumps[i]
        if pump.frequency_hz <= 0.0 and not pump.is_commanded:
            continue
        if pump.frequency_hz > 0.0:
            pump.run_s += 1.0
        if forcing.is_tripped[i, second]:
            pump.frequency_hz = 0.0
            continue
        nominal_hz = plant.pumps[i].nominal_frequency_hz
        wanted_hz = state.station[0].wanted_frequency_hz
        if is_by_hand and orders.speed_ratio[step, i] > 0.0:
            wanted_hz = orders.speed_ratio[step, i] * nominal_hz
        pump.frequency_hz = next_frequency_hz(
            pump.frequency_hz,
            pump.is_commanded,
            nominal_hz / station.ramp_s,
            station.min_frequency_hz,
            min(wanted_hz, nominal_hz),
            pump.dwell_left_s,
        )
        if not pump.is_commanded and pump.frequency_hz <= station.min_frequency_hz:
            pump.dwell_left_s -= 1.0
