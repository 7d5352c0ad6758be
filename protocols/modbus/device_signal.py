"""One signal of a PLC: where it stands, what form it has, and how its words become a value in house units."""

import math
import struct
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from wetwell.protocols.quantities import PUMP_QUANTITIES, STATION_QUANTITIES, pump_of
from wetwell.protocols.station.table import Finite, Table
from wetwell.protocols.units import factor, house_unit

SignalTable = Literal["coil", "discrete", "holding", "input"]
SignalType = Literal["float32", "uint16", "int16", "uint32", "int32", "bit"]
ByteOrder = Literal["ABCD", "CDAB", "BADC", "DCBA"]
"""Order in which the four bytes of a 32-bit value arrive, A being the highest."""

TABLE_OF_FUNCTION: dict[int, SignalTable] = {1: "coil", 2: "discrete", 3: "holding", 4: "input"}
BIT_TABLES = frozenset({"coil", "discrete"})
_FORMATS = {"float32": ">f", "uint32": ">I", "int32": ">i", "uint16": ">H", "int16": ">h"}


def _table(value: Any) -> Any:
    return TABLE_OF_FUNCTION.get(value, value) if isinstance(value, int) else value


class Signal(Table):
    r"""A value of a PLC.

    $$value = factor(unit) \cdot (scale \cdot raw + offset)$$

    and in unit "%" $low + (high - low) (scale \cdot raw + offset) / 100$ with `span` = (low, high).

    Attributes
    ----------
    table : "coil", "discrete", "holding" or "input"
        Or the function code that reads it, 1 to 4.
    address : int
        Address of its first register, from zero.
    type : str
        Form in which it stands there.
    bit : int, optional
        Of type "bit" in a table of words: which one, 0 being the lowest.
    scale, offset : float
        Of the raw number, before its unit is converted: `scale` in units a count, `offset` in the unit.
    unit : str
        Of the value after scale and offset; empty is the unit of the recording.
    span : (float, float), optional
        For unit "%": values at 0 % and at 100 % in the unit of the recording.
    word_order : str, optional
        Of a 32-bit value; default: the PLC's.
    no_value : tuple of int
        Raw numbers that stand for "no value", such as -32768.
    """

    table: Annotated[SignalTable, BeforeValidator(_table)] = "holding"
    address: Annotated[int, Field(ge=0, le=65535)]
    type: SignalType = "float32"
    bit: Annotated[int, Field(ge=0, le=15)] | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0
    unit: str = ""
    span: tuple[Finite, Finite] | None = None
    word_order: ByteOrder | None = None
    no_value: tuple[int, ...] = ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        in_bits = self.table in BIT_TABLES
        if in_bits and self.type != "bit":
            raise ValueError(f"type: got '{self.type}', a {self.table} is of type 'bit'")
        if (self.bit is not None) != (self.type == "bit" and not in_bits):
            raise ValueError("bit: is needed for type 'bit' in a table of words, and only there")
        if self.scale == 0.0:
            raise ValueError("scale: got 0, must not be 0")
        if (self.span is not None) != (self.unit == "%"):
            raise ValueError("span: [value at 0 %, value at 100 %] is needed for unit '%', and only there")
        if self.address + self.count > 65536:
            raise ValueError(f"address: got {self.address}, its last word lies beyond 65535")
        return self

    @property
    def count(self) -> int:
        """Words, or bits of a table of bits."""
        return 2 if self.type in {"float32", "uint32", "int32"} else 1

    def raw(self, words: Sequence[int], word_order: ByteOrder) -> float | None:
        """Number in the words of this signal; None if a float32 holds no finite one, or it is one of `no_value`.

        Examples
        --------
        >>> Signal(address=0, type="int32").raw([0xFFFF, 0xFFFE], "ABCD")
        -2.0
        """
        if self.type == "bit":
            return float(words[0] >> (self.bit or 0) & 1)
        packed = struct.pack(f">{len(words)}H", *words)
        order = self.word_order or word_order
        if self.count == 2 and order != "ABCD":
            packed = bytes(packed[order.index(letter)] for letter in "ABCD")
        number: float = struct.unpack(_FORMATS[self.type], packed)[0]
        return float(number) if math.isfinite(number) and number not in self.no_value else None

    def value(self, words: Sequence[int], word_order: ByteOrder, house: str) -> float | None:
        """Value in the unit of the house.

        Examples
        --------
        >>> Signal(address=0, type="int16", scale=0.5, unit="L/s").value([0xFFFE], "ABCD", "m³/h")
        -3.6
        """
        raw = self.raw(words, word_order)
        if raw is None:
            return None
        value = self.scale * raw + self.offset
        if self.span is not None:
            low, high = self.span
            value = low + (high - low) * value / 100.0
        elif self.unit not in {"", house}:
            value *= factor(self.unit, house)
        return value if math.isfinite(value) else None


def check_signal(name: str, signal: Signal, pumps: int | None) -> None:
    """Refuse a signal that a sample has no place for, or in a unit that cannot be turned into the house's.

    Parameters
    ----------
    name : str
        Column of a recording, "heartbeat" or "time_s".
    signal : Signal
        What is known of it.
    pumps : int, optional
        Number of pumps of the station, if it is known.

    Raises
    ------
    ValueError
        Names signal, value and rule.
    """
    number = pump_of(name)
    if number == 0 and name not in {*STATION_QUANTITIES, "heartbeat", "time_s"}:
        raise ValueError(
            f"signal.{name}: is no signal, must be {', '.join(STATION_QUANTITIES)}, heartbeat, time_s or "
            f"pump1_ and so on with {', '.join(PUMP_QUANTITIES)}"
        )
    if pumps is not None and number > pumps:
        raise ValueError(f"signal.{name}: the station has {pumps} pumps")
    if signal.unit and signal.unit != "%":
        try:
            factor(signal.unit, house_unit(name))
        except ValueError as error:
            raise ValueError(f"signal.{name}.{error}") from error
