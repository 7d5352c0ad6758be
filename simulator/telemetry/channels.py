"""The channels of a station's telemetry: level, inflow, then frequency, flow, head and power of each pump."""

from typing import Literal

from wetwell.protocols.jit import compiled

LEVEL = 0
INFLOW = 1
FIRST_PUMP = 2
FREQUENCY, FLOW, HEAD, POWER = range(4)

Quantity = Literal["level_m", "inflow_m3h", "frequency_hz", "flow_m3h", "head_m", "power_kw"]
PUMP_QUANTITIES: tuple[Quantity, ...] = ("frequency_hz", "flow_m3h", "head_m", "power_kw")


@compiled
def pump_channel(quantity: int, pump: int) -> int:
    """Channel of `FREQUENCY`, `FLOW`, `HEAD` or `POWER` of a pump (from 0)."""
    return FIRST_PUMP + 4 * pump + quantity


def channels(pumps: int) -> int:
    """Number of channels of a station.

    Examples
    --------
    >>> channels(3)
    14
    """
    return FIRST_PUMP + 4 * pumps


def channels_of(quantity: Quantity, pumps: int, pump: int | None = None) -> list[int]:
    """Channels that carry a quantity, of one pump (from 1) or of all.

    Examples
    --------
    >>> channels_of("head_m", 3), channels_of("head_m", 3, pump=2), channels_of("level_m", 3)
    ([4, 8, 12], [8], [0])
    """
    if quantity == "level_m":
        return [LEVEL]
    if quantity == "inflow_m3h":
        return [INFLOW]
    numbers = range(1, pumps + 1) if pump is None else [pump]
    return [FIRST_PUMP + 4 * (number - 1) + PUMP_QUANTITIES.index(quantity) for number in numbers]
