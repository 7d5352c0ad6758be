"""From the true station to its recording: scale, noise, delay, steps of a converter, reports on change."""

from dataclasses import dataclass, field

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.sim2real.truth.elastic.weather import wandering

TAILS = 8
"""Degrees of freedom of the white noise, after Student: wild values are more frequent than after Gauss. [1]"""


@dataclass(slots=True, kw_only=True)
class Instrument:
    """How a quantity comes to its column.

    Attributes
    ----------
    factor, shift : float or (n,) array
        Reading = factor x + shift, while its pump turns or water moves. [1, unit]
    delay_s : float or (n,) array
        Age of what arrives; between two seconds the younger one. [s]
    step, step_from : float
        Steps of the converter, which rounds, and where they count from. [unit, unit]
    threshold, pause_s, report_s : float
        A value is sent when it has moved so far, but not within a pause, and after a time in any case. [unit, s, s]
    """

    factor: float | Floats = 1.0
    shift: float | Floats = 0.0
    delay_s: float | Floats = 0.0
    step: float = 0.0
    step_from: float = 0.0
    threshold: float = 0.0
    pause_s: float = 0.0
    report_s: float = np.inf


@dataclass(slots=True, kw_only=True)
class Instruments:
    """Instruments by quantity; those of one pump come before those of all."""

    of_all: dict[AnalogueQuantity, Instrument] = field(default_factory=dict)

    def of(self, quantity: AnalogueQuantity) -> Instrument:
        """The instrument of a quantity, to be changed."""
        return self.of_all.setdefault(quantity, Instrument())


def read(true_values: Floats, is_alive: Flags, noise: Floats, instrument: Instrument) -> Floats:
    """(n,) readings with relative noise; 0 while there is nothing to read."""
    return np.where(is_alive, (instrument.factor * true_values + instrument.shift) * (1.0 + noise), 0.0)


def arrived(reading: Floats, instrument: Instrument) -> Floats:
    """(n,) values as they are recorded."""
    seconds = np.arange(reading.size)
    if np.any(np.asarray(instrument.delay_s) > 0.0):
        reading = reading[np.maximum(np.ceil(seconds - instrument.delay_s).astype(np.int64), 0)]
    if instrument.step > 0.0:
        counts = np.round((reading - instrument.step_from) / instrument.step)
        reading = counts * instrument.step + instrument.step_from
    return _sent(reading, instrument) if instrument.threshold > 0.0 else reading


def _sent(reading: Floats, instrument: Instrument) -> Floats:
    kept = np.empty_like(reading)
    held, since_s = reading[0], 0.0
    for second, value in enumerate(reading.tolist()):
        since_s += 1.0
        has_moved = abs(value - held) > instrument.threshold and since_s > instrument.pause_s
        if has_moved or since_s >= instrument.report_s:
            held, since_s = value, 0.0
        kept[second] = held
    return kept


def sensor_noise(count: int, slow_share: float, slow_s: float, rng: np.random.Generator) -> Floats:
    """(count,) noise of unit variance: white with wide tails, and a share that wanders."""
    white = np.asarray(rng.standard_t(TAILS, count) * np.sqrt((TAILS - 2.0) / TAILS))
    if slow_share <= 0.0:
        return white
    return np.asarray(np.sqrt(1.0 - slow_share) * white + np.sqrt(slow_share) * wandering(count, slow_s, rng))
