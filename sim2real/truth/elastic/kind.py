"""What a deviation of the elastic plant is: drawn for a station, worked into a truth in the making."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.truth.elastic.instruments import Instruments
from wetwell.sim2real.truth.elastic.kernel import Weather
from wetwell.sim2real.truth.elastic.spec import HOUR_S, ElasticSpec, Machinery, duty, rated_power_w

Parameters = dict[str, float | str]


@dataclass(slots=True, kw_only=True)
class ElasticTruth:
    """A truth in the making: deviations change all of it but the station as its file says."""

    station: Station
    machinery: Machinery
    spec: ElasticSpec
    weather: Weather
    instruments: Instruments
    metered_inflow: Floats
    rng: np.random.Generator

    def change(self, **changes: Any) -> None:
        """Replace fields of the spec."""
        self.spec = self.spec._replace(**changes)

    @property
    def time_s(self) -> Floats:
        """(n,) seconds since the start."""
        return np.arange(self.weather.loss.size, dtype=np.float64)

    def of_pump(self, values: Floats, pump: float, value: float) -> Floats:
        """Values of all pumps with that of one (from 1), or of all (0), replaced."""
        chosen = np.arange(1, values.size + 1)
        return np.where((chosen == pump) | (pump == 0), value, values)


@dataclass(frozen=True, slots=True)
class Sizes:
    """What sizes of deviations are drawn with: generator, station, scales of its first pump.

    A size is drawn evenly in its logarithm: from what just matters to somebody to what nobody overlooks.
    """

    rng: np.random.Generator
    station: Station

    @property
    def flow_m3h(self) -> float:
        """Flow of the first pump alone. [m³/h]."""
        return duty(self.station, 0)[0] * HOUR_S

    @property
    def head_m(self) -> float:
        """Head of the first pump alone. [m]."""
        return duty(self.station, 0)[1]

    @property
    def power_kw(self) -> float:
        """Power of the first pump alone. [kW]."""
        return rated_power_w(self.station, 0) / 1000.0

    @property
    def depth_m(self) -> float:
        """Between first start and stop levels. [m]."""
        return self.station.control.start_levels_m[0] - self.station.control.stop_levels_m[0]

    def size(self, least: float, most: float) -> float:
        """A positive size, four digits."""
        return digits(math.exp(self.rng.uniform(math.log(least), math.log(most))))

    def even(self, least: float, most: float) -> float:
        """A value, evenly, four digits."""
        return digits(self.rng.uniform(least, most))

    def sign(self) -> float:
        """One up or down."""
        return float(self.rng.choice((-1.0, 1.0)))

    def pump(self) -> float:
        """In half of the cases one pump, from 1; else all of them, 0."""
        return float(self.rng.integers(1, len(self.station.pump) + 1)) if self.rng.random() < 0.5 else 0.0

    def one_of(self, *names: str) -> str:
        """One of some names."""
        return str(self.rng.choice(names))


@dataclass(frozen=True, slots=True)
class ElasticKind:
    """A way to deviate: where it lies, where it must show itself, how it is drawn and what it does.

    What lies between the meter of the inflow and the wet well is nothing without that meter.
    """

    component: str
    signals: tuple[AnalogueQuantity, ...]
    draw: Callable[[Sizes], Parameters]
    act: Callable[[ElasticTruth, Mapping[str, Any]], None]
    needs_two_pumps: bool = False
    is_behind_meter: bool = False


def digits(value: float) -> float:
    """Value with four significant digits.

    Examples
    --------
    >>> digits(0.0123456)
    0.01235
    """
    return float(f"{value:.4g}")
