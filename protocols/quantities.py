"""What is measured at a station: the one list that messages, recordings, registers, stores and compiled code go by.

A row of values holds those of the station, then those of each pump: `columns_of`.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Literal

SensedQuantity = Literal["level_m", "inflow_m3h", "flow_m3h", "head_m", "power_kw"]
"""What an instrument measures."""
AnalogueQuantity = Literal["level_m", "inflow_m3h", "frequency_hz", "flow_m3h", "head_m", "power_kw"]
"""What has a unit: the same, and the frequency, which the drive tells."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """What is measured once at a station, or once at each of its pumps.

    Attributes
    ----------
    name : str
        Field of a message; column of a recording, which says the pump first.
    unit : str
        Empty for a flag.
    description : str
        For people, with the place of the pump's number.
    """

    name: AnalogueQuantity | Literal["running"]
    unit: str
    description: str


_STATION = (
    Quantity("level_m", "m", "Level in the wet well"),
    Quantity("inflow_m3h", "m³/h", "Inflow to the wet well"),
)
_PUMP = (
    Quantity("frequency_hz", "Hz", "Drive frequency of pump {pump}"),
    Quantity("flow_m3h", "m³/h", "Flow of pump {pump}"),
    Quantity("head_m", "m", "Head of pump {pump}"),
    Quantity("power_kw", "kW", "Electrical power of pump {pump}"),
    Quantity("running", "", "Pump {pump}: 1 running, 0 standing"),
)

STATION_QUANTITIES: Mapping[str, Quantity] = MappingProxyType({each.name: each for each in _STATION})
PUMP_QUANTITIES: Mapping[str, Quantity] = MappingProxyType({each.name: each for each in _PUMP})
"""By their names, in the order of a row."""
PUMP_ANALOGUES: tuple[AnalogueQuantity, ...] = tuple(each.name for each in _PUMP if each.name != "running")
PUMP_METERS: tuple[AnalogueQuantity, ...] = tuple(name for name in PUMP_ANALOGUES if name != "frequency_hz")
"""What the instruments of a pump measure."""

HAND_COLUMNS: Mapping[str, str] = MappingProxyType(
    {
        "by_hand": "1 while a crew commands the pumps, else 0",
        "valve_open": "0 while the valves of the mains are shut, else 1",
        "inlet_open": "0 while the inlet is shut, else 1",
    }
)
"""Columns of a recording that tell what a crew did, and what they say."""

SIGNALS: Mapping[str, SensedQuantity] = MappingProxyType(
    {"level": "level_m", "inflow": "inflow_m3h", "flow": "flow_m3h", "head": "head_m", "power": "power_kw"}
)
"""What an instrument measures, by the word for it."""

LEVEL, INFLOW = range(len(_STATION))
FIRST_PUMP = len(_STATION)
"""Places in a row: the values of the station, then those of the first pump."""
FREQUENCY, FLOW, HEAD, POWER, RUNNING = range(len(_PUMP))
PUMP_VALUES = len(_PUMP)
"""Places in the values of a pump, and how many they are."""

_PUMP_COLUMN = re.compile(rf"pump([1-9]\d*)_({'|'.join(PUMP_QUANTITIES)})")


def pump_column(pump: int, name: str) -> str:
    """Column of a quantity of a pump (from 1).

    Examples
    --------
    >>> pump_column(2, "head_m")
    'pump2_head_m'
    """
    return f"pump{pump}_{name}"


@lru_cache
def columns_of(pumps: int) -> tuple[str, ...]:
    """Columns of a station with so many pumps, in the order of a row.

    Examples
    --------
    >>> columns_of(1)[:4]
    ('level_m', 'inflow_m3h', 'pump1_frequency_hz', 'pump1_flow_m3h')
    """
    of_pumps = (pump_column(pump, name) for pump in range(1, pumps + 1) for name in PUMP_QUANTITIES)
    return (*STATION_QUANTITIES, *of_pumps)


def pump_of(column: str) -> int:
    """Number of the pump that a column belongs to, from 1; 0 for those of the station and for what is no column.

    Examples
    --------
    >>> pump_of("pump12_head_m"), pump_of("level_m"), pump_of("pump1_colour")
    (12, 0, 0)
    """
    match = _PUMP_COLUMN.fullmatch(column)
    return int(match[1]) if match else 0


def quantity_of(column: str) -> AnalogueQuantity | Literal["running"] | None:
    """What a column holds; None for what is no column.

    Examples
    --------
    >>> quantity_of("pump12_head_m"), quantity_of("level_m"), quantity_of("pump1_colour")
    ('head_m', 'level_m', None)
    """
    match = _PUMP_COLUMN.fullmatch(column)
    found = (PUMP_QUANTITIES if match else STATION_QUANTITIES).get(match[2] if match else column)
    return found.name if found else None


def pumps_of(columns: Iterable[str]) -> int:
    """Number of pumps that columns speak of.

    Examples
    --------
    >>> pumps_of(["level_m", "pump2_head_m"]), pumps_of([])
    (2, 0)
    """
    return max(map(pump_of, columns), default=0)


def pumps_of_width(values: int) -> int:
    """Number of pumps in a row of so many values.

    Examples
    --------
    >>> pumps_of_width(len(columns_of(3)))
    3
    """
    return (values - FIRST_PUMP) // PUMP_VALUES
