"""Axes: what they reach from and to, where their ticks are, how they look."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from math import ceil, floor, isfinite, log10

import numpy as np
from numpy.typing import NDArray

from wetwell.services.reports.charts.svg import BOTTOM, GRID, HEIGHT, LEFT, RIGHT, TOP, WIDTH, text_at

_TIME_STEPS_S = (1, 5, 15, 30, 60, 300, 900, 1800, 3600, 10_800, 21_600, 43_200, 86_400, 172_800, 604_800, 2_419_200)


@dataclass(frozen=True)
class Scale:
    """Straight map of values onto pixels."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        """Pixel of a value."""
        return self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)


def y_axis(values: Iterable[float], label: str) -> tuple[Scale, list[str]]:
    """Upright axis from tick to tick, wide enough for all values, and what it looks like."""
    low, high = range_of(values, 1.0)
    step = _step(low, high)
    low, high = floor(low / step + 1e-9) * step, ceil(high / step - 1e-9) * step
    scale = Scale(low, high, HEIGHT - BOTTOM, TOP)
    body = []
    for value, text in ticks(low, high):
        y = scale(value)
        body.append(
            f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" style="stroke:{GRID}"/>'
            f"{text_at(text, LEFT - 6, y + 4, 'end')}"
        )
    middle = (TOP + HEIGHT - BOTTOM) / 2
    body.append(f'<g transform="rotate(-90 14 {middle})">{text_at(label, 14, middle, "middle")}</g>')
    return scale, body


def range_of(values: Iterable[float], least: float) -> tuple[float, float]:
    """Least and greatest finite value; a range that is nothing is opened by `least`."""
    finite = [float(v) for v in values if isfinite(v)]
    low, high = min(finite, default=0.0), max(finite, default=0.0)
    return (low, high) if high > low else (low, low + max(least, abs(low) * 1e-3))


def _step(low: float, high: float) -> float:
    """Distance of about six ticks: 1, 2 or 5 times a power of ten."""
    rough = (high - low) / 6.0
    power = 10.0 ** floor(log10(rough))
    return next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= rough * (1.0 - 1e-9))


def ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Values and words of about six ticks."""
    step = _step(low, high)
    digits = max(-floor(log10(step)), 0)
    places = range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)
    return [(place * step, f"{place * step:.{digits}f}") for place in places]


def time_ticks(low_ns: float, high_ns: float) -> list[tuple[float, str]]:
    """Stamps and words of at most eight ticks, in UTC."""
    length_s = (high_ns - low_ns) / 1e9
    step_s = next((step for step in _TIME_STEPS_S if length_s / step <= 8), _TIME_STEPS_S[-1])
    step_s *= max(ceil(length_s / step_s / 8), 1)
    form = (
        "%H:%M:%S"
        if step_s < 60
        else "%H:%M"
        if length_s <= 86_400
        else "%m-%d %H:%M"
        if step_s < 86_400
        else "%m-%d"
    )
    places = range(ceil(low_ns / 1e9 / step_s), floor(high_ns / 1e9 / step_s) + 1)
    return [(place * step_s * 1e9, datetime.fromtimestamp(place * step_s, UTC).strftime(form)) for place in places]


def extremes(values: NDArray[np.float64]) -> list[float]:
    """Least and greatest finite value; nothing if there is none."""
    finite = values[np.isfinite(values)]
    return [float(finite.min()), float(finite.max())] if finite.size else []
