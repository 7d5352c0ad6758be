"""One poll of a PLC: its registers read block by block, and what it refuses found out."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from wetwell.protocols.modbus.block_reads import Block, halves
from wetwell.protocols.modbus.client import ModbusConnection, RefusedError
from wetwell.protocols.modbus.device_map import Plc
from wetwell.protocols.units import house_unit

_ABSENT_CODES = frozenset({5, 6, 10, 11})
"""Exceptions of a device that is busy, or that the Modbus gateway before it does not reach."""
_ADDRESS_CODES = frozenset({2, 3, 4})
"""Exceptions that may concern a part of a block only."""


@dataclass(frozen=True)
class Poll:
    """What one poll has brought.

    Attributes
    ----------
    values : mapping of name to float or None
        In the units of the house; None is "no value".
    words : mapping of name to words
        As the device sent them; without those that it refused.
    refused : mapping of name to str
        Why the device refused it.
    blocks : list of Block
        Requests that the device answers as a whole: those for the next poll.
    """

    values: dict[str, float | None] = field(default_factory=dict)
    words: dict[str, list[int]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)


async def poll_once(connection: ModbusConnection, plc: Plc, blocks: Sequence[Block]) -> Poll:
    """Read all signals of a PLC.

    A block that is refused is read in halves, down to the register that is to blame; that one has no value.

    Raises
    ------
    RefusedError
        If the device is absent behind its gateway, or refuses all. The connection is good.
    LinkError
        If it does not answer, or wrongly. The connection must be closed.
    """
    poll = Poll()
    for block in blocks:
        await _read(connection, plc, block, poll)
    if len(poll.refused) == len(plc.signals):
        raise RefusedError(0, f"all registers are refused, such as {next(iter(poll.refused.values()))}")
    return poll


async def _read(connection: ModbusConnection, plc: Plc, block: Block, poll: Poll) -> None:
    try:
        words = await connection.read(block.table, block.address, block.count)
    except RefusedError as error:
        if error.code in _ABSENT_CODES:
            raise
        parts = halves(block, plc.signals) if error.code in _ADDRESS_CODES else ()
        for part in parts:
            await _read(connection, plc, part, poll)
        if not parts:
            poll.blocks.append(block)
            poll.values.update(dict.fromkeys(block.names))
            poll.refused.update(dict.fromkeys(block.names, str(error)))
        return
    poll.blocks.append(block)
    for name in block.names:
        signal = plc.signals[name]
        poll.words[name] = block.words_of(signal, words)
        poll.values[name] = signal.value(poll.words[name], plc.device.word_order, house_unit(name))
