"""What is measured at a station in one second, whatever it came in: a message of the bus, or a row of a recording."""

# ruff: noqa: D102 - the names are those of the messages

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, Protocol

from wetwell.protocols.quantities import PUMP_QUANTITIES, STATION_QUANTITIES


class PumpReadings(Protocol):
    """What is measured at one pump; None and NaN are "no value"."""

    @property
    def frequency_hz(self) -> float | None: ...
    @property
    def flow_m3h(self) -> float | None: ...
    @property
    def head_m(self) -> float | None: ...
    @property
    def power_kw(self) -> float | None: ...
    @property
    def running(self) -> bool | None: ...


class Readings(Protocol):
    """What is measured at one station; `time` in nanoseconds since 1970, `seq` counting within a source's life."""

    @property
    def seq(self) -> int: ...
    @property
    def time(self) -> int: ...
    @property
    def level_m(self) -> float | None: ...
    @property
    def inflow_m3h(self) -> float | None: ...
    @property
    def pumps(self) -> Sequence[PumpReadings]: ...
    @property
    def quality(self) -> str: ...


class PumpRow(NamedTuple):
    """The columns of one pump in a row of a recording."""

    frequency_hz: float
    flow_m3h: float
    head_m: float
    power_kw: float
    running: bool | None


class Row(NamedTuple):
    """A row of a recording: a tenth of the cost of a message that is checked."""

    seq: int
    time: int
    level_m: float
    inflow_m3h: float
    pumps: tuple[PumpRow, ...]
    quality: str = "good"


class HasPumps(Protocol):
    """What has the quantities of a station, and of each of its pumps, in fields of their names."""

    @property
    def pumps(self) -> Sequence[object]: ...


_of_station: Callable[[object], tuple[Any, ...]] = attrgetter(*STATION_QUANTITIES)
_of_pump: Callable[[object], tuple[Any, ...]] = attrgetter(*PUMP_QUANTITIES)


def row_values(readings: HasPumps) -> list[Any]:
    """What such fields hold, in the order of a row: those of the station, then those of each pump."""
    values = list(_of_station(readings))
    for pump in readings.pumps:
        values.extend(_of_pump(pump))
    return values
