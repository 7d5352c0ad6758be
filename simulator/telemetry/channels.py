"""The channels of a station's telemetry: level, inflow, then frequency, flow, head and power of each pump."""

from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, PUMP_ANALOGUES, STATION_QUANTITIES, AnalogueQuantity

PUMP_CHANNELS = len(PUMP_ANALOGUES)


@compiled
def pump_channel(quantity: int, pump: int) -> int:
    """Channel of `FREQUENCY`, `FLOW`, `HEAD` or `POWER` of a pump (from 0)."""
    return FIRST_PUMP + PUMP_CHANNELS * pump + quantity


def channels(pumps: int) -> int:
    """Number of channels of a station.

    Examples
    --------
    >>> channels(3)
    14
    """
    return FIRST_PUMP + PUMP_CHANNELS * pumps


def channels_of(quantity: AnalogueQuantity, pumps: int, pump: int | None = None) -> list[int]:
    """Channels that carry a quantity, of one pump (from 1) or of all.

    Examples
    --------
    >>> channels_of("head_m", 3), channels_of("head_m", 3, pump=2), channels_of("level_m", 3)
    ([4, 8, 12], [8], [0])
    """
    if quantity in STATION_QUANTITIES:
        return [list(STATION_QUANTITIES).index(quantity)]
    numbers = range(1, pumps + 1) if pump is None else [pump]
    return [FIRST_PUMP + PUMP_CHANNELS * (number - 1) + PUMP_ANALOGUES.index(quantity) for number in numbers]
