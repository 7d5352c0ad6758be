"""What a crew did at the station in each second of a recording, by the columns that say so."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.recordings.recording import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class ByHand:
    """What a crew did; (n,) arrays.

    Attributes
    ----------
    is_commanding : array
        Whether it commanded the pumps, so that no start and no stop tells of the controller.
    is_valve_shut : array
        Whether the valves of the mains were shut.
    is_inlet_shut : array
        Whether nothing came in by the inlet.
    """

    is_commanding: Flags
    is_valve_shut: Flags
    is_inlet_shut: Flags

    def taken(self, second: Integers) -> "ByHand":
        """Of some seconds, one after the other; nothing was done in those under 0."""
        is_there = second >= 0
        return ByHand(
            is_commanding=self.is_commanding[second] & is_there,
            is_valve_shut=self.is_valve_shut[second] & is_there,
            is_inlet_shut=self.is_inlet_shut[second] & is_there,
        )


def left_alone(seconds: int) -> ByHand:
    """Nobody was there."""
    never = np.zeros(seconds, dtype=np.bool_)
    return ByHand(is_commanding=never, is_valve_shut=never, is_inlet_shut=never)


def joined_hands(parts: Sequence[ByHand]) -> ByHand:
    """One after the other."""
    return ByHand(
        **{field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(ByHand)}
    )


def by_hand_of(recording: Recording, second: Integers, seconds: int) -> ByHand:
    """What was done in each second: what the row at it or before it says.

    Parameters
    ----------
    recording : Recording
    second : (rows,) array
        Second of each row.
    seconds : int
    """
    row = np.maximum(np.searchsorted(second, np.arange(seconds), side="right") - 1, 0)

    def seen(name: str, usual: float) -> Floats:
        values = recording.column(name)
        return np.where(np.isnan(values), usual, values)[row]

    return ByHand(
        is_commanding=seen("by_hand", 0.0) > 0.0,
        is_valve_shut=seen("valve_open", 1.0) <= 0.0,
        is_inlet_shut=seen("inlet_open", 1.0) <= 0.0,
    )
