"""From the true station to the rows of its recording: gain, noise, limits, delay, counts, reports."""

from dataclasses import dataclass, field

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.quantities import AnalogueQuantity


@dataclass(slots=True, kw_only=True)
class Channel:
    """How one quantity comes to its column; changed in place by deviations and faults.

    Attributes
    ----------
    gain, offset : float or (n,) array
        Reading = gain x + bend x² + offset, while the channel is alive (its pump turns or water moves).
    bend : float
        Curvature of the scale, in one over the unit.
    cutoff : float
        Reads 0 under it, and again over 1.05 times it.
    delay_s : float or (n,) array
        Age of the value that arrives, interpolated. [s]
    count : float
        Size of a count of the converter, which cuts off what is less; 0 for none.
    deadband, report_s : float
        A value is sent when it has moved so far, or after a time. [unit, s]
    """

    gain: float | Floats = 1.0
    offset: float | Floats = 0.0
    bend: float = 0.0
    cutoff: float = 0.0
    delay_s: float | Floats = 0.0
    count: float = 0.0
    deadband: float = 0.0
    report_s: float = np.inf


@dataclass(slots=True, kw_only=True)
class Telemetry:
    """Channels by quantity, the same for all pumps."""

    channel: dict[AnalogueQuantity, Channel] = field(default_factory=dict)

    def of(self, quantity: AnalogueQuantity) -> Channel:
        """The channel of a quantity, to be changed."""
        return self.channel.setdefault(quantity, Channel())


def sensed(true_values: Floats, is_alive: Flags, noise: Floats, channel: Channel) -> Floats:
    """(n,) readings before transmission; a dead channel reads exactly 0.

    Parameters
    ----------
    true_values, noise : (n,) arrays
        In the unit of the channel, and relative.
    is_alive : (n,) array
    channel : Channel
    """
    reading = (channel.gain * true_values + channel.bend * true_values**2 + channel.offset) * (1.0 + noise)
    return np.where(is_alive, _with_cutoff(reading, channel.cutoff), 0.0)


def transmitted(reading: Floats, channel: Channel) -> Floats:
    """(n,) readings as they arrive: late, in whole counts, sent by exception."""
    seconds = np.arange(reading.size, dtype=np.float64)
    if np.any(np.asarray(channel.delay_s) > 0.0):
        reading = np.interp(seconds - channel.delay_s, seconds, reading)
    if channel.count > 0.0:
        reading = np.floor(reading / channel.count) * channel.count
    if channel.deadband > 0.0:
        reading = by_exception(reading, channel.deadband, channel.report_s)
    return reading


def _with_cutoff(reading: Floats, cutoff: float) -> Floats:
    if cutoff <= 0.0:
        return reading
    state = np.where(reading < cutoff, 0, np.where(reading > 1.05 * cutoff, 1, -1))
    last = np.maximum.accumulate(np.where(state >= 0, np.arange(reading.size), 0))
    return np.where(state[last] == 1, reading, 0.0)


def by_exception(reading: Floats, deadband: float, report_s: float) -> Floats:
    """(n,) values as they are sent when they have moved by a deadband, or after so many seconds.

    Examples
    --------
    >>> by_exception(np.array([0.0, 0.4, 1.0, 1.2, 2.1]), 1.0, 3.0)
    array([0. , 0. , 1. , 1. , 2.1])
    """
    sent = reading.copy()
    last, age = reading[0], 0
    for row, value in enumerate(reading.tolist()):
        age += 1
        if abs(value - last) >= deadband or age >= report_s:
            last, age = value, 0
        sent[row] = last
    return sent
