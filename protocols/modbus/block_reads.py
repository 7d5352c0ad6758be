"""Signals that are read in one request: neighbours, with small gaps between them."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby

from wetwell.protocols.modbus.device_signal import BIT_TABLES, Signal, SignalTable

MAX_BITS = 2000
"""Most bits of one request; of words a device says it itself, at most 125."""


@dataclass(frozen=True)
class Block:
    """One request: `count` registers or bits from `address`, for these signals, by their places."""

    table: SignalTable
    address: int
    count: int
    names: tuple[str, ...]

    def words_of(self, signal: Signal, words: list[int]) -> list[int]:
        """The words of one of its signals in the answer."""
        first = signal.address - self.address
        return words[first : first + signal.count]


def plan_blocks(signals: Mapping[str, Signal], max_gap: int, max_words: int) -> tuple[Block, ...]:
    """Fewest requests that fetch all signals, if each signal goes into the first one that can take it.

    Parameters
    ----------
    signals : mapping of name to Signal
        What is to be read.
    max_gap : int
        Registers between two signals that may be read for nothing.
    max_words : int
        Most words of a request.

    Examples
    --------
    >>> signals = {"level_m": Signal(address=0), "inflow_m3h": Signal(address=4), "heartbeat": Signal(address=99)}
    >>> [(block.address, block.count) for block in plan_blocks(signals, 16, 125)]
    [(0, 6), (99, 2)]
    """
    blocks: list[Block] = []
    order = sorted(signals.items(), key=lambda item: (item[1].table, item[1].address))
    for table, group in groupby(order, key=lambda item: item[1].table):
        largest = MAX_BITS if table in BIT_TABLES else max_words
        first, end = 0, 0
        names: list[str] = []
        for name, signal in group:
            new_end = max(end, signal.address + signal.count)
            if names and (signal.address - end > max_gap or new_end - first > largest):
                blocks.append(Block(table, first, end - first, tuple(names)))
                names = []
            if not names:
                first, new_end = signal.address, signal.address + signal.count
            names.append(name)
            end = new_end
        blocks.append(Block(table, first, end - first, tuple(names)))
    return tuple(blocks)


def halves(block: Block, signals: Mapping[str, Signal]) -> tuple[Block, ...]:
    """A block in two, to find out which of its registers a device refuses; none if it has one signal only."""
    middle = len(block.names) // 2
    return tuple(
        _around(block.table, names, signals) for names in (block.names[:middle], block.names[middle:]) if middle
    )


def _around(table: SignalTable, names: tuple[str, ...], signals: Mapping[str, Signal]) -> Block:
    first = min(signals[name].address for name in names)
    end = max(signals[name].address + signals[name].count for name in names)
    return Block(table, first, end - first, names)
