"""The one register table of the PLC: server, gateway and documentation come from it.

Station block from address 0, a block of 20 words a pump from 100, settings from 1000; addresses count from zero.
Measured values have the same addresses in the input (function code 04) and holding table (03). Words between the
registers of these blocks are reserved and read 0, so that one request can fetch several blocks.
"""

import csv
import io
import math
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Literal

from wetwell.protocols.quantities import PUMP_QUANTITIES, STATION_QUANTITIES, Quantity, pump_column

Table = Literal["coil", "holding", "input"]
Type = Literal["float32", "uint16", "uint32", "bit"]
Access = Literal["r", "rw"]
WordOrder = Literal["ABCD", "CDAB"]
"""Order of the two words of a 32-bit value; bytes within a word are big-endian."""

MAX_PUMPS = 32
PUMP_BLOCK = 100
PUMP_STRIDE = 20
SETTINGS_BLOCK = 1000
_Row = tuple[str, int, Type, str, str]
_COUNTS: dict[Type, int] = {"float32": 2, "uint16": 1, "uint32": 2, "bit": 1}
_MAXIMA: dict[Type, int] = {"uint16": 0xFFFF, "uint32": 0xFFFF_FFFF, "bit": 1}
_FLOAT, _LONG, _WORDS = struct.Struct(">f"), struct.Struct(">I"), struct.Struct(">HH")


@dataclass(frozen=True, slots=True, kw_only=True)
class Register:
    """One row of the register table.

    Attributes
    ----------
    name : str
        Column of a recording, or name of a setting.
    table : "coil", "holding" or "input"
        Read by function code 01, 03 or 04.
    address : int
        First address, from zero.
    count : int
        Words of 16 bit, or coils.
    type : "float32", "uint16", "uint32" or "bit"
        A missing value is NaN in float32 and 0 in the others.
    unit : str
        Empty for a plain number.
    access : "r" or "rw"
        A write to "r" is refused.
    description : str
        For people.
    """

    name: str
    table: Table
    address: int
    count: int
    type: Type
    unit: str
    access: Access
    description: str


def register_table(pumps: int, levels: int) -> tuple[Register, ...]:
    """Registers of a station: measured values as input and as holding registers, settings, coils.

    Parameters
    ----------
    pumps : int
        Number of pumps, 1 to 32.
    levels : int
        Number of pairs of start and stop level, 1 to 32.

    Raises
    ------
    ValueError
        If a number is out of its range.

    Examples
    --------
    >>> [(row.name, row.table, row.address) for row in register_table(1, 1)][:2]
    [('level_m', 'input', 0), ('inflow_m3h', 'input', 2)]
    """
    for name, number in (("pumps", pumps), ("levels", levels)):
        if not 1 <= number <= MAX_PUMPS:
            raise ValueError(f"{name} must lie in [1, {MAX_PUMPS}], got {number}")
    return (
        *_registers("input", "r", _measured(pumps)),
        *_registers("holding", "r", _measured(pumps)),
        *_registers("holding", "rw", _level_settings(levels)),
        *_registers("coil", "rw", _auto_settings(pumps)),
    )


def measured_words(pumps: int) -> int:
    """Number of words from address 0 to the end of the last pump's block."""
    return PUMP_BLOCK + PUMP_STRIDE * pumps


def _measured(pumps: int) -> Iterable[_Row]:
    for place, quantity in enumerate(STATION_QUANTITIES.values()):
        yield quantity.name, 2 * place, _type_of(quantity), quantity.unit, quantity.description
    yield "heartbeat", 4, "uint16", "", "Counts up each scan of the PLC, stands when its program stops"
    yield "time_s", 6, "uint32", "s", "Clock of the PLC, seconds since 1970 UTC"
    for i in range(1, pumps + 1):
        block = PUMP_BLOCK + PUMP_STRIDE * (i - 1)
        for place, quantity in enumerate(PUMP_QUANTITIES.values()):
            name, description = pump_column(i, quantity.name), quantity.description.format(pump=i)
            yield name, block + 2 * place, _type_of(quantity), quantity.unit, description


def _type_of(quantity: Quantity) -> Type:
    return "float32" if quantity.unit else "uint16"


def _level_settings(levels: int) -> Iterable[_Row]:
    for n in range(1, levels + 1):
        pair = SETTINGS_BLOCK + 4 * (n - 1)
        yield f"start_level{n}_m", pair, "float32", "m", f"Level at which the pump number {n} in rotation starts"
        yield f"stop_level{n}_m", pair + 2, "float32", "m", f"Level at which the pump number {n} in rotation stops"


def _auto_settings(pumps: int) -> Iterable[_Row]:
    for i in range(1, pumps + 1):
        yield f"pump{i}_auto", i - 1, "bit", "", f"Pump {i}: 1 automatic, 0 off"


def _registers(table: Table, access: Access, rows: Iterable[_Row]) -> Iterable[Register]:
    for name, address, kind, unit, description in rows:
        yield Register(
            name=name,
            table=table,
            address=address,
            count=_COUNTS[kind],
            type=kind,
            unit=unit,
            access=access,
            description=description,
        )


def encode(register: Register, value: float | None, word_order: WordOrder) -> list[int]:
    """Words of a value; None, NaN and infinities are "no value".

    Raises
    ------
    ValueError
        If the value does not fit the register's type; names register and rule.

    Examples
    --------
    >>> encode(register_table(1, 1)[0], 1.5, "ABCD")
    [16320, 0]
    """
    has_value = value is not None and math.isfinite(value)
    if register.type == "float32":
        try:
            packed = _FLOAT.pack(value if has_value else math.nan)
        except OverflowError as error:
            raise ValueError(f"{register.name} must fit a 32-bit float, got {value}") from error
    else:
        number = int(value) if value is not None and has_value else 0
        maximum = _MAXIMA[register.type]
        if not 0 <= number <= maximum or (has_value and number != value):
            raise ValueError(f"{register.name} must be a whole number in [0, {maximum}], got {value}")
        if register.count == 1:
            return [number]
        packed = _LONG.pack(number)
    high, low = _WORDS.unpack(packed)
    return [high, low] if word_order == "ABCD" else [low, high]


def decode(register: Register, words: Sequence[int], word_order: WordOrder) -> float | None:
    """Value in the words of a register; None where a float32 holds no finite number.

    Raises
    ------
    ValueError
        If the number of words is not that of the register.

    Examples
    --------
    >>> decode(register_table(1, 1)[0], [16320, 0], "ABCD")
    1.5
    """
    if len(words) != register.count:
        raise ValueError(f"{register.name} has {register.count} words, got {len(words)}")
    if register.count == 1:
        return float(words[0])
    packed = _WORDS.pack(*(words if word_order == "ABCD" else reversed(words)))
    if register.type == "uint32":
        return float(_LONG.unpack(packed)[0])
    value: float = _FLOAT.unpack(packed)[0]
    return value if math.isfinite(value) else None


def register_csv(registers: Iterable[Register]) -> str:
    """CSV text of a register table, one row a register.

    Examples
    --------
    >>> print(register_csv(register_table(1, 1)[:1]), end="")
    name,table,address,count,type,unit,access,description
    level_m,input,0,2,float32,m,r,Level in the wet well
    """
    text = io.StringIO()
    names = [field.name for field in fields(Register)]
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([getattr(register, name) for name in names] for register in registers)
    return text.getvalue()
