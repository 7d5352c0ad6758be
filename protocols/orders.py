"""What an operator orders: steps in which pumps run at speeds that are set, and valves stand as told.

The simulator and the plants that stand for reality obey the same steps; nothing of their hydraulics is here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.jit import compiled

AUTOMATIC = -1
"""Number of the step while the controller decides alone."""
SHUT_LOSS = 1e6
"""Times by which a valve that is shut raises the loss of a main: a thousandth of the flow is left. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A step of an order; it ends by time or by the level that the operator reads, and the next begins.

    Attributes
    ----------
    longest_s : float
        [s]
    speed_ratio : tuple of float, optional
        Speed of each pump as a share of nominal, 0 to stand; None leaves all to the controller. [1]
    low_m, high_m : float
        The step ends when the level falls to the one or rises to the other. [m]
    is_valve_shut : bool
        Whether the valves of all mains are shut.
    is_inlet_shut : bool
        Whether the inlet is: what the inflow meter sees stays in the sewer.
    """

    longest_s: float
    speed_ratio: tuple[float, ...] | None = None
    low_m: float = -math.inf
    high_m: float = math.inf
    is_valve_shut: bool = False
    is_inlet_shut: bool = False


class Orders(NamedTuple):
    """Steps as compiled code reads them: (steps, pumps) speeds, the rest (steps,)."""

    speed_ratio: Floats
    is_by_hand: Flags
    longest_s: Floats
    low_m: Floats
    high_m: Floats
    is_valve_shut: Flags
    is_inlet_shut: Flags

    def columns(self, step: Integers) -> dict[str, Floats]:
        """Columns of a recording that tell what was done; none without a step.

        Parameters
        ----------
        step : (n,) array
            In force in each second, or `AUTOMATIC`.
        """
        if self.longest_s.size == 0:
            return {}
        is_on = step >= 0
        return {
            "by_hand": (is_on & self.is_by_hand[step]).astype(np.float64),
            "valve_open": (~(is_on & self.is_valve_shut[step])).astype(np.float64),
            "inlet_open": (~(is_on & self.is_inlet_shut[step])).astype(np.float64),
        }


def orders_of(steps: Sequence[Step], pumps: int) -> Orders:
    """Orders for a station with so many pumps.

    Raises
    ------
    ValueError
        If a step names another number of pumps, or a speed that is not from 0 to 1.
    """
    ratios = [(0.0,) * pumps if step.speed_ratio is None else step.speed_ratio for step in steps]
    for number, ratio in enumerate(ratios, start=1):
        if len(ratio) != pumps:
            raise ValueError(f"step {number}: speed_ratio: got {len(ratio)} speeds, the station has {pumps} pumps")
        if not all(0.0 <= one <= 1.0 for one in ratio):
            raise ValueError(f"step {number}: speed_ratio: got {ratio}, must be from 0 to 1")
    return Orders(
        speed_ratio=np.array(ratios, dtype=np.float64).reshape(len(steps), pumps),
        is_by_hand=np.array([step.speed_ratio is not None for step in steps], dtype=np.bool_),
        longest_s=np.array([step.longest_s for step in steps], dtype=np.float64),
        low_m=np.array([step.low_m for step in steps], dtype=np.float64),
        high_m=np.array([step.high_m for step in steps], dtype=np.float64),
        is_valve_shut=np.array([step.is_valve_shut for step in steps], dtype=np.bool_),
        is_inlet_shut=np.array([step.is_inlet_shut for step in steps], dtype=np.bool_),
    )


def first_place() -> Integers:
    """(3,) place in the orders at the beginning: step that is next or on, its seconds so far, step in force."""
    return np.array([0, 0, AUTOMATIC], dtype=np.int64)


@compiled
def go_on(orders: Orders, place: Integers, level_m: float) -> int:
    """Move the place in the orders on by a second; the step that is in force from now on, or `AUTOMATIC`.

    Parameters
    ----------
    orders : Orders
    place : (3,) array
        As `first_place` makes it; changed in place.
    level_m : float
        As the operator reads it. [m]

    Examples
    --------
    >>> place = first_place()
    >>> orders = orders_of([Step(longest_s=2, speed_ratio=(1.0,)), Step(longest_s=9, low_m=1.0)], 1)
    >>> [go_on(orders, place, level_m) for level_m in (2.0, 2.0, 2.0, 1.0)]
    [0, 0, 1, -1]
    """
    place[2] = AUTOMATIC
    while place[0] < orders.longest_s.size:
        step = place[0]
        if place[1] < orders.longest_s[step] and orders.low_m[step] < level_m < orders.high_m[step]:
            place[1] += 1
            place[2] = step
            break
        place[0] += 1
        place[1] = 0
    return int(place[2])


@compiled
def valves(orders: Orders, step: int) -> tuple[float, float]:
    """Factor on the loss of the mains, and share of the inflow that comes in, in a step or `AUTOMATIC`. [1, 1]."""
    if step < 0:
        return 1.0, 1.0
    return SHUT_LOSS if orders.is_valve_shut[step] else 1.0, 0.0 if orders.is_inlet_shut[step] else 1.0
