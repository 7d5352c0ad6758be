"""What a deviation of the truth is: parameters drawn at random for a station, worked into a truth in the making."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.truth.spec import Spec, Surroundings, duty_m3h
from wetwell.sim2real.truth.telemetry import Telemetry

Parameters = dict[str, float | str]
DIGITS = 4


@dataclass(slots=True, kw_only=True)
class Truth:
    """A truth in the making: deviations replace its spec, and work into its surroundings and telemetry.

    Attributes
    ----------
    station : Station
        As its file says.
    spec : Spec
    around : Surroundings
    telemetry : Telemetry
    rng : numpy.random.Generator
        Of the deviations alone.
    level_noise_m : (n,) array
        Part of the level's error that is noise. [m]
    """

    station: Station
    spec: Spec
    around: Surroundings
    telemetry: Telemetry
    rng: np.random.Generator
    level_noise_m: Floats

    def change(self, **changes: Any) -> None:
        """Replace fields of the spec."""
        self.spec = self.spec._replace(**changes)

    @property
    def time_s(self) -> Floats:
        """(n,) seconds since the start."""
        return np.arange(self.around.loss_factor.size, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """What parameters are drawn with: generator, station, and its scales.

    Attributes
    ----------
    rng : numpy.random.Generator
    station : Station
    flow_m3h, head_m : float
        Duty of one pump. [m³/h, m]
    """

    rng: np.random.Generator
    station: Station
    flow_m3h: float
    head_m: float

    def between(self, low: float, high: float) -> float:
        """Even between two values, with few digits."""
        return rounded(self.rng.uniform(low, high))

    def over(self, low: float, high: float) -> float:
        """Even in the logarithm between two positive values, with few digits."""
        return rounded(math.exp(self.rng.uniform(math.log(low), math.log(high))))

    def either(self, value: float, other: float) -> float:
        """One of two values."""
        return rounded(value if self.rng.random() < 0.5 else other)

    @property
    def pump(self) -> float:
        """All pumps (0), or one of them, from 1."""
        return self.either(0.0, float(self.rng.integers(1, len(self.station.pump) + 1)))

    @property
    def depth_m(self) -> float:
        """Between the first start and stop levels. [m]."""
        return self.station.control.start_levels_m[0] - self.station.control.stop_levels_m[0]


@dataclass(frozen=True, slots=True)
class Kind:
    """A way to deviate.

    Attributes
    ----------
    component : str
        Where it lies.
    signals : tuple of str
        Quantities in which it must show itself; others may follow through the control.
    draw, act : callable
    needs_two_pumps : bool
        Whether it shows only when two pumps run.
    is_behind_meter : bool
        Whether it lies between the meter of the inflow and the wet well: without that meter it is nothing.
    """

    component: str
    signals: tuple[AnalogueQuantity, ...]
    draw: Callable[[Draw], Parameters]
    act: Callable[[Truth, Mapping[str, Any]], None]
    needs_two_pumps: bool = False
    is_behind_meter: bool = False


def rounded(value: float) -> float:
    """Value with `DIGITS` significant digits."""
    return float(f"{value:.{DIGITS}g}")


def draw_of(station: Station, rng: np.random.Generator) -> Draw:
    """What parameters are drawn with at a station."""
    flow_m3h, head_m = duty_m3h(station)
    return Draw(rng=rng, station=station, flow_m3h=flow_m3h, head_m=head_m)
