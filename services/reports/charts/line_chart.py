"""Lines over a straight or a time axis, and dots with curves through them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wetwell.services.reports.charts.axes import Scale, extremes, range_of, ticks, time_ticks, y_axis
from wetwell.services.reports.charts.svg import (
    BOTTOM,
    HEIGHT,
    LEFT,
    MUTED,
    RIGHT,
    TOP,
    WIDTH,
    colour,
    legend,
    svg,
    text_at,
)


@dataclass(frozen=True)
class Series:
    """Named points of a chart; NaN in `y` leaves a gap. On a time axis `x` is in ns since 1970."""

    name: str
    x: ArrayLike
    y: ArrayLike


@dataclass(frozen=True)
class Span:
    """Stretch of the x axis that is shaded and named, such as the time of a fault."""

    name: str
    begin: float
    end: float


def line_chart(
    title: str,
    series: Sequence[Series],
    *,
    x_label: str = "",
    y_label: str = "",
    description: str = "",
    is_time: bool = False,
    limits: Mapping[str, float] | None = None,
    spans: Sequence[Span] = (),
) -> str:
    """SVG with a line for each series.

    Parameters
    ----------
    title, description : str
        Shown above the chart; read to those who cannot see it (default: what is drawn).
    series : sequence of Series
        At most six are told apart by colour. Long series are drawn by the least and greatest value a pixel.
    x_label, y_label : str
        Names of the axes, with unit.
    is_time : bool
        Whether `x` is in ns since 1970, UTC.
    limits : mapping of str to float, optional
        Dashed horizontal lines by name, such as start levels.
    spans : sequence of Span
        Shaded stretches of the x axis.

    Returns
    -------
    svg : str
    """
    limits = limits or {}
    x_scale, y_scale, body = _frame(series, x_label, y_label, limits.values(), spans, is_time=is_time)
    for place, one in enumerate(series):
        body.append(_path(_unbroken(*_thinned(*_points(one), x_scale)), x_scale, y_scale, place))
    for name, value in limits.items():
        y = y_scale(value)
        body.append(
            f'<line class="limit" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke-dasharray="5 4" '
            f'style="stroke:{MUTED}"/>{text_at(name, WIDTH - RIGHT, y - 3, "end")}'
        )
    return svg(title, description or _told("Lines", series, y_label), [*body, *legend([s.name for s in series])])


def scatter(
    title: str,
    series: Sequence[Series],
    *,
    lines: Sequence[Series] = (),
    x_label: str = "",
    y_label: str = "",
    description: str = "",
) -> str:
    """SVG with a dot for each point of `series`, and `lines` (curves to compare with) in the colours that follow."""
    x_scale, y_scale, body = _frame([*series, *lines], x_label, y_label, (), (), is_time=False)
    for place, one in enumerate(series):
        dots = [
            f'<circle cx="{x_scale(a):.1f}" cy="{y_scale(b):.1f}" r="2.5"/>'
            for part in _unbroken(*_points(one))
            for a, b in part
        ]
        body.append(f'<g style="fill:{colour(place)}" fill-opacity="0.6">{"".join(dots)}</g>')
    for place, one in enumerate(lines, start=len(series)):
        body.append(_path(_unbroken(*_points(one)), x_scale, y_scale, place))
    names = [one.name for one in [*series, *lines]]
    return svg(title, description or _told("Dots", series, y_label), [*body, *legend(names)])


def _frame(
    series: Sequence[Series],
    x_label: str,
    y_label: str,
    y_also: Iterable[float],
    spans: Sequence[Span],
    *,
    is_time: bool,
) -> tuple[Scale, Scale, list[str]]:
    """Both axes, wide enough for all points, and what they look like."""
    points = [_points(one) for one in series]
    y_scale, body = y_axis([*(v for _, y in points for v in extremes(y)), *y_also], y_label)
    ends = [*(v for x, _ in points for v in extremes(x)), *(v for span in spans for v in (span.begin, span.end))]
    low, high = range_of(ends, 1e9 if is_time else 1.0)
    x_scale = Scale(low, high, LEFT, WIDTH - RIGHT)
    for value, label in time_ticks(low, high) if is_time else ticks(low, high):
        x = x_scale(value)
        body.append(
            f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{HEIGHT - BOTTOM}" y2="{HEIGHT - BOTTOM + 4}" '
            f'style="stroke:{MUTED}"/>{text_at(label, x, HEIGHT - BOTTOM + 16, "middle")}'
        )
    body.append(text_at(x_label, (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, "middle"))
    for span in spans:
        begin, end = x_scale(span.begin), x_scale(span.end)
        body.append(
            f'<rect class="span" x="{begin:.1f}" y="{TOP}" width="{max(end - begin, 1.0):.1f}" '
            f'height="{HEIGHT - TOP - BOTTOM}" style="fill:{MUTED}" fill-opacity="0.15">'
            f"<title>{escape(span.name)}</title></rect>{text_at(span.name, begin + 3, TOP + 12, 'start')}"
        )
    return x_scale, y_scale, body


def _points(series: Series) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y = np.asarray(series.x, dtype=np.float64), np.asarray(series.y, dtype=np.float64)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError(f"series '{series.name}': x has shape {x.shape}, y {y.shape}, must be equal and flat")
    return x, y


def _thinned(
    x: NDArray[np.float64], y: NDArray[np.float64], scale: Scale
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of each pixel's points the least, the greatest and a gap, in order; short series as they are."""
    if len(x) <= 2 * WIDTH:
        return x, y
    pixel = np.floor((x - scale.low) / (scale.high - scale.low) * (scale.end - scale.start)).astype(np.int64)
    begin = np.flatnonzero(np.diff(pixel, prepend=pixel[0] - 1))
    order = np.lexsort((y, pixel))  # of each pixel the least first, gaps last
    known = np.add.reduceat(~np.isnan(y), begin, dtype=np.int64)
    some, all_known = known > 0, begin + known == np.append(begin[1:], len(x))
    least, greatest = order[begin[some]], order[(begin + known - 1)[some]]
    kept = np.unique(np.concatenate([least, greatest, order[(begin + known)[~all_known]]]))
    return x[kept], y[kept]


def _unbroken(x: NDArray[np.float64], y: NDArray[np.float64]) -> list[list[tuple[float, float]]]:
    """Stretches of points without a gap."""
    parts: list[list[tuple[float, float]]] = [[]]
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if isfinite(a) and isfinite(b):
            parts[-1].append((a, b))
        elif parts[-1]:
            parts.append([])
    return [part for part in parts if part]


def _path(parts: Sequence[Sequence[tuple[float, float]]], x_scale: Scale, y_scale: Scale, place: int) -> str:
    path = "".join("M" + "L".join(f"{x_scale(a):.1f},{y_scale(b):.1f}" for a, b in part) for part in parts)
    return f'<path d="{path}" fill="none" stroke-width="1.5" style="stroke:{colour(place)}"/>'


def _told(kind: str, series: Sequence[Series], y_label: str) -> str:
    each = []
    for one in series:
        ends = extremes(_points(one)[1])
        each.append(f"{one.name} from {ends[0]:.4g} to {ends[1]:.4g}" if ends else f"{one.name} without a value")
    return f"{kind}{f' of {y_label}' if y_label else ''}: {'; '.join(each) or 'none'}."
