"""State of a plant: what it carries from a second to the next, changed in place by the kernel."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.orders import AUTOMATIC, first_place
from wetwell.simulator.corrections.parts import TERMS
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.records import Records, records_of
from wetwell.simulator.rising_main.waves import NODES
from wetwell.simulator.telemetry.channels import channels
from wetwell.simulator.wet_well import SECONDS_PER_HOUR, volume_at_level_m3

MAX_DELAY_S = 119
PAST_S = MAX_DELAY_S + 2
MAX_STARTS_PER_HOUR = 60
LONG_REST_S = 1.0e5
"""For so long a plant has stood when it begins: as long as any air takes to gather. [s]"""


@dataclass(slots=True)
class StationState:
    """Wet well and controller.

    The frequency that running pumps go to, the memory of the level controller, the number of running pumps, the pump
    whose turn it is, and the seconds since the beginning.
    """

    volume_m3: float = 0.0
    wanted_frequency_hz: float = math.inf
    pid_integral_hz: float = 0.0
    pid_level_m: float = 0.0
    has_pid_level: bool = False
    running: int = 0
    turn: int = 0
    second: int = 0


@dataclass(slots=True)
class PumpState:
    """Drive and pump.

    For corrections: seconds of this run and of this rest, and for how long nothing had moved in its pipe before.
    """

    frequency_hz: float = 0.0
    shaft_ratio: float = 0.0
    air_m: float = 0.0
    ragging: float = 0.0
    dwell_left_s: float = 0.0
    run_s: float = 0.0
    turned_s: float = 0.0
    rested_s: float = LONG_REST_S
    idle_before_s: float = LONG_REST_S
    is_commanded: bool = False
    is_ready: bool = False


@dataclass(slots=True)
class ChannelState:
    """Sensor and telemetry of a channel; NaN where nothing has been read or sent yet."""

    undamped: float = math.nan
    damped: float = math.nan
    damped_again: float = math.nan
    last_noise: float = 0.0
    last_reading: float = math.nan
    last_sent: float = math.nan


class PlantState(NamedTuple):
    """State of a plant; of the station there is one record.

    The hydraulics works on arrays of one value a pump: (pumps, 3) curves, its speed, the same where its check valve
    is open and else 0, the flows now and before a step, and their means over the second. `back_m3h` (mains,) runs
    back at the inlet of each main whose water is accelerated as a whole. `water` (pumps, 2, nodes + 1) is that in the
    main of each, where waves run; that of a header is its first pump's. `correction` (terms, pumps) is what learnt
    corrections add to each term, 0 without any, and `covariates` (covariates,) what the one at hand goes by. `past`
    (channels, m) and `level_history` (m,) are rings of the last seconds. `started` holds the commanded pumps in the
    order of their starts; `recent_starts` (pumps, k) the seconds of the last starts of each, the newest first.
    `place` is that in the orders of an operator.
    """

    station: Records[StationState]
    pumps: Records[PumpState]
    channels: Records[ChannelState]
    curves: Floats
    speed_ratio: Floats
    open_ratio: Floats
    flow_m3h: Floats
    flow_before_m3h: Floats
    mean_flow_m3h: Floats
    back_m3h: Floats
    water: Floats
    correction: Floats
    past: Floats
    level_history: Floats
    started: Integers
    recent_starts: Integers
    place: Integers


class Truth(NamedTuple):
    """What truly was in n seconds: level and overflow (n,); flow, head and power of the pumps (pumps, n).

    `step` (n,) is the step of the orders in force, or `AUTOMATIC`.
    """

    level_m: Floats
    overflow_m3h: Floats
    flow_m3h: Floats
    head_m: Floats
    power_kw: Floats
    step: Integers


def first_state(parameters: PlantParameters, level_m: float) -> PlantState:
    """State with all pumps standing at a level, for so long that all air has gathered."""
    pumps = len(parameters.pumps)
    return PlantState(
        station=records_of([StationState(volume_m3=volume_at_level_m3(level_m, parameters.profile))]),
        pumps=records_of([PumpState(air_m=parameters.main_of(i).air_head_m) for i in range(pumps)]),
        channels=records_of([ChannelState()] * channels(pumps)),
        curves=np.zeros((pumps, 3)),
        speed_ratio=np.zeros(pumps),
        open_ratio=np.zeros(pumps),
        flow_m3h=np.zeros(pumps),
        flow_before_m3h=np.zeros(pumps),
        mean_flow_m3h=np.zeros(pumps),
        back_m3h=np.zeros(len(parameters.mains)),
        water=np.zeros((pumps, 2, NODES + 1)),
        correction=np.zeros((len(TERMS), pumps)),
        past=np.full((channels(pumps), PAST_S), np.nan),
        level_history=np.full(PAST_S, np.nan),
        started=np.zeros(pumps, dtype=np.int64),
        recent_starts=np.full((pumps, MAX_STARTS_PER_HOUR), -SECONDS_PER_HOUR, dtype=np.int64),
        place=first_place(),
    )


def still_truth(pumps: int, seconds: int) -> Truth:
    """Room for the truth of a block, in which the pumps stand."""
    step = np.full(seconds, AUTOMATIC, dtype=np.int64)
    flow_m3h, head_m, power_kw = np.zeros((3, pumps, seconds))
    return Truth(np.empty(seconds), np.empty(seconds), flow_m3h, head_m, power_kw, step)
