"""What a true recording is made from: station as believed, deviations of the truth from it, faults, inflow, noise."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wetwell.protocols.orders import Step
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.truth.storage import EVERY_SECOND, Storage

FaultKind = Literal[
    "blockage", "clogging", "static_rise", "sensor_stuck", "sensor_bias", "sensor_drift", "sensor_gap"
]
START_NS = 1_736_121_600_000_000_000
"""2025-01-06T00:00:00Z, a Monday."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """One thing that is otherwise than the station file says, by name, with parameters.

    Names are those of the library of effects, or of the open ones in `deviations.py`. Parameters that mean the same
    as one of the library's have its name and unit.
    """

    name: str
    parameters: Mapping[str, float | str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthFault:
    """A fault that comes at `start_s`, is full at `end_s` and stays.

    `size` is the loss of speed of a blockage, the relative rise of friction of a clogging, metres of a static rise,
    a bias in units of the channel, or a drift in those units per hour. `pump` counts from 1; 0 is the whole
    station, or all pumps.
    """

    kind: FaultKind
    start_s: float
    end_s: float
    size: float = 0.0
    pump: int = 0
    channel: AnalogueQuantity = "flow_m3h"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueInflow:
    """Two humps a day, a slow random part, and pulses of rain.

    Attributes
    ----------
    mean_m3h, swing, noise : float
        Mean; amplitude of the humps and spread of the random part as shares of it. [m³/h, 1, 1]
    noise_s : float
        Correlation time of the random part. [s]
    rain_per_day, rain_m3h, rain_s : float
        Pulses t exp(1 - t), their peak and the time to it. [1/d, m³/h, s]
    most_m3h : float
        What the sewer carries at most. [m³/h]
    """

    mean_m3h: float = 90.0
    swing: float = 0.4
    noise: float = 0.08
    noise_s: float = 600.0
    rain_per_day: float = 4.0
    rain_m3h: float = 180.0
    rain_s: float = 900.0
    most_m3h: float = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthCase:
    """All that one true recording is made from.

    Attributes
    ----------
    station : Station
        As its file says; the truth differs by the deviations.
    deviations, faults : tuple
    inflow : TrueInflow
    seconds, seed : int
        Length and seed. [s, 1]
    initial_level_m : float
        [m]
    slow_share, slow_s : float
        Share of the sensors' variance that is slow, as an AR(1), and its correlation time. [1, s]
    start_ns : int
        Time of the first second. [ns]
    storage : Storage
        What the historian keeps of it.
    steps : tuple of Step
        What an operator does from the first second on.
    """

    station: Station
    deviations: tuple[Deviation, ...] = ()
    faults: tuple[TruthFault, ...] = ()
    inflow: TrueInflow = TrueInflow()
    seconds: int = 86_400
    seed: int = 1
    initial_level_m: float = 1.0
    slow_share: float = 0.0
    slow_s: float = 30.0
    start_ns: int = START_NS
    storage: Storage = EVERY_SECOND
    steps: tuple[Step, ...] = ()
