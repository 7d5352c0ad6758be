"""A PLC in virtual time: a recording behind a Modbus connection that may be slow, refuse, or be gone."""

import asyncio
import random
from typing import Self

from wetwell.protocols.errors import LinkError
from wetwell.protocols.modbus.client import NoAnswerError, RefusedError
from wetwell.protocols.modbus.device_map import Device, Plc
from wetwell.protocols.modbus.device_signal import Signal
from wetwell.protocols.modbus.registers import encode, register_table
from wetwell.protocols.recordings.recording import Recording


class SimulatedPlc:
    """Registers that follow a recording, one row a period of the poll.

    `trouble` is what the next requests meet: "" for none, "away", "silent" or "refuses".
    """

    def __init__(self, station: str, recording: Recording, period_s: float, dice: random.Random) -> None:
        self.trouble = ""
        self.recording = recording
        self._period_s = period_s
        self._dice = dice
        self._table = [row for row in register_table(recording.pumps, 1) if row.table == "input"]
        self._words: dict[int, int] = {}
        self._row = -1
        signals = {
            row.name: Signal(table="input", address=row.address, type=row.type)
            for row in self._table
            if row.name in recording.columns or row.name == "heartbeat"
        }
        device = Device(station=station, host="simulated", period_s=period_s, heartbeat_s=3.0 * period_s)
        self.plc = Plc(station=station, pumps=recording.pumps, device=device, signals=signals)

    @property
    def is_over(self) -> bool:
        """Whether the recording has ended."""
        return _now_s() >= len(self.recording) * self._period_s

    def read(self, address: int, count: int) -> list[int]:
        """Words of the row that is due."""
        row = min(int(_now_s() / self._period_s), len(self.recording) - 1)
        if row != self._row:
            self._row = row
            for register in self._table:
                value = row % 65_536 if register.name == "heartbeat" else self._value(register.name, row)
                self._words.update(enumerate(encode(register, value, "ABCD"), start=register.address))
        return [self._words.get(word, 0) for word in range(address, address + count)]

    def _value(self, name: str, row: int) -> float | None:
        return float(self.recording.columns[name][row]) if name in self.recording.columns else None

    def connection(self) -> "SimulatedConnection":
        """Connection of a gateway, not yet opened."""
        return SimulatedConnection(self, self._dice)


class SimulatedConnection:
    """What the gateway uses in place of its Modbus connection."""

    def __init__(self, plc: SimulatedPlc, dice: random.Random) -> None:
        self._plc = plc
        self._dice = dice

    async def __aenter__(self) -> Self:
        await asyncio.sleep(self._dice.uniform(0.001, 0.05))
        if self._plc.trouble == "away":
            raise LinkError("cannot connect: simulated")
        return self

    async def __aexit__(self, *_: object) -> None:
        pass

    async def read(self, _table: str, address: int, count: int) -> list[int]:
        """Answer a request, or not."""
        await asyncio.sleep(self._dice.uniform(0.001, 0.02))
        match self._plc.trouble:
            case "away":
                raise LinkError("connection lost: simulated")
            case "silent":
                await asyncio.sleep(1.0)
                raise NoAnswerError("no answer: simulated")
            case "refuses":
                raise RefusedError(6, "busy: simulated")
        return self._plc.read(address, count)


def _now_s() -> float:
    return asyncio.get_running_loop().time()
