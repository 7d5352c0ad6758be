"""Charts as SVG and reports as one HTML page that needs no network: texts in, texts out.

Colours are CSS variables with a default each, so that a chart stands alone and follows the page's light or dark
scheme. Every chart has a title and a description for screen readers.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from itertools import pairwise
from math import ceil, floor, isfinite, log10

import numpy as np
from numpy.typing import ArrayLike, NDArray

WIDTH, HEIGHT = 760, 300
LEFT, RIGHT, TOP, BOTTOM = 64, 36, 44, 48
_COLOURS = ("#2563eb", "#d97706", "#059669", "#dc2626", "#7c3aed", "#64748b")
_DARK_COLOURS = ("#60a5fa", "#fbbf24", "#34d399", "#f87171", "#a78bfa", "#94a3b8")
_TIME_STEPS_S = (1, 5, 15, 30, 60, 300, 900, 1800, 3600, 10_800, 21_600, 43_200, 86_400, 172_800, 604_800, 2_419_200)


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


@dataclass(frozen=True)
class Section:
    """Part of a page: a heading and ready-made HTML (charts, `table`, `paragraph`)."""

    heading: str
    body: str


@dataclass(frozen=True)
class _Scale:
    """Straight map of values onto pixels."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        return self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)


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
            f'style="stroke:{_INK_SOFT}"/>{_text(name, WIDTH - RIGHT, y - 3, "end")}'
        )
    return _svg(title, description or _told("Lines", series, y_label), [*body, *_legend([s.name for s in series])])


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
        body.append(f'<g style="fill:{_colour(place)}" fill-opacity="0.6">{"".join(dots)}</g>')
    for place, one in enumerate(lines, start=len(series)):
        body.append(_path(_unbroken(*_points(one)), x_scale, y_scale, place))
    names = [one.name for one in [*series, *lines]]
    return _svg(title, description or _told("Dots", series, y_label), [*body, *_legend(names)])


def bar_chart(
    title: str,
    categories: Sequence[str],
    groups: Mapping[str, ArrayLike],
    *,
    y_label: str = "",
    description: str = "",
) -> str:
    """SVG with bars side by side.

    Parameters
    ----------
    categories : sequence of str
        Names along the x axis.
    groups : mapping of str to array, shape (len(categories),)
        Heights by name of the group; NaN draws no bar, a negative value hangs from zero.

    Raises
    ------
    ValueError
        If a group has not one height for each category.
    """
    heights = {name: np.asarray(values, dtype=np.float64) for name, values in groups.items()}
    for name, values in heights.items():
        if values.shape != (len(categories),):
            raise ValueError(f"group '{name}': shape {values.shape}, must be ({len(categories)},)")
    y_scale, body = _y_axis([0.0, *(v for values in heights.values() for v in values)], y_label)
    step = (WIDTH - LEFT - RIGHT) / max(len(categories), 1)
    width = 0.8 * step / max(len(heights), 1)
    every = ceil(len(categories) * 7 * max(map(len, categories), default=1) / (WIDTH - LEFT - RIGHT)) or 1
    for column, category in enumerate(categories):
        left = LEFT + column * step
        if column % every == 0:
            body.append(_text(category, left + step / 2, HEIGHT - BOTTOM + 16, "middle"))
        for place, (name, values) in enumerate(heights.items()):
            value = float(values[column])
            if not isfinite(value):
                continue
            ends = sorted((y_scale(0.0), y_scale(value)))
            body.append(
                f'<rect class="bar" x="{left + 0.1 * step + place * width:.1f}" y="{ends[0]:.1f}" '
                f'width="{width:.1f}" height="{ends[1] - ends[0]:.1f}" style="fill:{_colour(place)}">'
                f"<title>{escape(f'{category}, {name}: {value:g}')}</title></rect>"
            )
    told = f"Bars of {', '.join(heights)}{f' in {y_label}' if y_label else ''} for {len(categories)} categories."
    return _svg(title, description or told, [*body, *_legend(list(heights))])


def heat_map(
    title: str,
    rows: Sequence[str],
    columns: Sequence[str],
    values: ArrayLike,
    *,
    row_label: str = "",
    column_label: str = "",
    description: str = "",
) -> str:
    """SVG with a shaded cell and its number for each value, such as a confusion matrix.

    Parameters
    ----------
    values : array, shape (len(rows), len(columns))
        The strongest shade is the greatest value, no shade is zero or less; NaN leaves the cell empty.

    Raises
    ------
    ValueError
        If the values have another shape.
    """
    cells = np.asarray(values, dtype=np.float64)
    if cells.shape != (len(rows), len(columns)):
        raise ValueError(f"values: shape {cells.shape}, must be ({len(rows)}, {len(columns)})")
    left = min(24 + 7 * max(map(len, rows), default=0), WIDTH // 2)
    cell_width = (WIDTH - left - RIGHT) / max(len(columns), 1)
    cell_height = 28
    height = TOP + 24 + cell_height * len(rows) + 24
    fits = max(int(cell_width / 7), 1)
    most = max((v for v in cells.flat if isfinite(v)), default=0.0)
    body = [_text(row_label, 4, TOP + 14, "start"), _text(column_label, (left + WIDTH) / 2, height - 6, "middle")]
    for j, name in enumerate(columns):
        short = name if len(name) <= fits else name[: max(fits - 1, 1)] + "…"
        body.append(_text(short, left + (j + 0.5) * cell_width, TOP + 14, "middle", name))
    for i, row in enumerate(rows):
        top = TOP + 20 + i * cell_height
        body.append(_text(row, left - 6, top + 18, "end"))
        for j, column in enumerate(columns):
            value = float(cells[i, j])
            if not isfinite(value):
                continue
            shade = 0.6 * max(value, 0.0) / most if most > 0.0 else 0.0
            x = left + j * cell_width
            body.append(
                f'<rect class="cell" x="{x:.1f}" y="{top}" width="{cell_width:.1f}" height="{cell_height}" '
                f'style="fill:{_colour(0)};stroke:{_GRID}" fill-opacity="{shade:.3f}">'
                f"<title>{escape(f'{row}, {column}: {value:g}')}</title></rect>"
                f"{_text(f'{value:.3g}' if value % 1.0 else f'{value:.0f}', x + cell_width / 2, top + 18, 'middle')}"
            )
    told = f"Table of {len(rows)} rows and {len(columns)} columns, shaded by value, greatest {most:g}."
    return _svg(title, description or told, body, height)


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """HTML table; floats with four digits, None as a dash.

    Examples
    --------
    >>> table(["pump", "NMAE"], [[1, 0.01234567]]).count("<td>")
    2
    """
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in columns)
    body = "".join(f"<tr>{''.join(f'<td>{escape(_cell(value))}</td>' for value in row)}</tr>" for row in rows)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def paragraph(text: str) -> str:
    """Plain text as an HTML paragraph.

    Examples
    --------
    >>> paragraph("r < 1")
    '<p>r &lt; 1</p>'
    """
    return f"<p>{escape(text)}</p>"


def page(title: str, sections: Iterable[Section]) -> str:
    """Self-contained HTML page: no script, no font, no image from elsewhere; also well-formed XML."""
    body = "".join(f"<section><h2>{escape(s.heading)}</h2>{s.body}</section>" for s in sections)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>"
        f"<body><main><h1>{escape(title)}</h1>{body}</main></body></html>\n"
    )


_INK, _INK_SOFT, _GRID = "var(--ink,#1f2937)", "var(--ink-soft,#6b7280)", "var(--grid,#e5e7eb)"
_STYLE = (
    ":root{color-scheme:light dark;--paper:#fff;--ink:#1f2937;--ink-soft:#6b7280;--grid:#e5e7eb;"
    + "".join(f"--series-{i}:{colour};" for i, colour in enumerate(_COLOURS))
    + "}@media (prefers-color-scheme:dark){:root{--paper:#111827;--ink:#e5e7eb;--ink-soft:#9ca3af;--grid:#374151;"
    + "".join(f"--series-{i}:{colour};" for i, colour in enumerate(_DARK_COLOURS))
    + "}}body{background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,sans-serif;margin:0}"
    "main{max-width:50rem;margin:0 auto;padding:1rem}svg{max-width:100%;height:auto}.table{overflow-x:auto}"
    "table{border-collapse:collapse}th,td{border-bottom:1px solid var(--grid);padding:.25rem .75rem;text-align:left}"
)


def _frame(
    series: Sequence[Series],
    x_label: str,
    y_label: str,
    y_also: Iterable[float],
    spans: Sequence[Span],
    *,
    is_time: bool,
) -> tuple[_Scale, _Scale, list[str]]:
    """Both axes, wide enough for all points, and what they look like."""
    points = [_points(one) for one in series]
    y_scale, body = _y_axis([*(v for _, y in points for v in _extremes(y)), *y_also], y_label)
    ends = [*(v for x, _ in points for v in _extremes(x)), *(v for span in spans for v in (span.begin, span.end))]
    low, high = _range(ends, 1e9 if is_time else 1.0)
    x_scale = _Scale(low, high, LEFT, WIDTH - RIGHT)
    for value, label in _time_ticks(low, high) if is_time else _ticks(low, high):
        x = x_scale(value)
        body.append(
            f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{HEIGHT - BOTTOM}" y2="{HEIGHT - BOTTOM + 4}" '
            f'style="stroke:{_INK_SOFT}"/>{_text(label, x, HEIGHT - BOTTOM + 16, "middle")}'
        )
    body.append(_text(x_label, (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, "middle"))
    for span in spans:
        begin, end = x_scale(span.begin), x_scale(span.end)
        body.append(
            f'<rect class="span" x="{begin:.1f}" y="{TOP}" width="{max(end - begin, 1.0):.1f}" '
            f'height="{HEIGHT - TOP - BOTTOM}" style="fill:{_INK_SOFT}" fill-opacity="0.15">'
            f"<title>{escape(span.name)}</title></rect>{_text(span.name, begin + 3, TOP + 12, 'start')}"
        )
    return x_scale, y_scale, body


def _y_axis(values: Iterable[float], label: str) -> tuple[_Scale, list[str]]:
    low, high = _range(values, 1.0)
    step = _step(low, high)
    low, high = floor(low / step + 1e-9) * step, ceil(high / step - 1e-9) * step
    scale = _Scale(low, high, HEIGHT - BOTTOM, TOP)
    body = []
    for value, text in _ticks(low, high):
        y = scale(value)
        body.append(
            f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" style="stroke:{_GRID}"/>'
            f"{_text(text, LEFT - 6, y + 4, 'end')}"
        )
    middle = (TOP + HEIGHT - BOTTOM) / 2
    body.append(f'<g transform="rotate(-90 14 {middle})">{_text(label, 14, middle, "middle")}</g>')
    return scale, body


def _range(values: Iterable[float], least: float) -> tuple[float, float]:
    """Least and greatest finite value; a range that is nothing is opened by `least`."""
    finite = [float(v) for v in values if isfinite(v)]
    low, high = min(finite, default=0.0), max(finite, default=0.0)
    return (low, high) if high > low else (low, low + max(least, abs(low) * 1e-3))


def _step(low: float, high: float) -> float:
    """Distance of about six ticks: 1, 2 or 5 times a power of ten."""
    rough = (high - low) / 6.0
    power = 10.0 ** floor(log10(rough))
    return next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= rough * (1.0 - 1e-9))


def _ticks(low: float, high: float) -> list[tuple[float, str]]:
    step = _step(low, high)
    digits = max(-floor(log10(step)), 0)
    places = range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)
    return [(place * step, f"{place * step:.{digits}f}") for place in places]


def _time_ticks(low_ns: float, high_ns: float) -> list[tuple[float, str]]:
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


def _points(series: Series) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y = np.asarray(series.x, dtype=np.float64), np.asarray(series.y, dtype=np.float64)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError(f"series '{series.name}': x has shape {x.shape}, y {y.shape}, must be equal and flat")
    return x, y


def _extremes(values: NDArray[np.float64]) -> list[float]:
    finite = values[np.isfinite(values)]
    return [float(finite.min()), float(finite.max())] if finite.size else []


def _thinned(
    x: NDArray[np.float64], y: NDArray[np.float64], scale: _Scale
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of each pixel's points the least, the greatest and a gap, in order; short series as they are."""
    if len(x) <= 2 * WIDTH:
        return x, y
    pixel = np.floor((x - scale.low) / (scale.high - scale.low) * (scale.end - scale.start)).astype(np.int64)
    keep: set[int] = set()
    for begin, stop in pairwise([0, *(np.flatnonzero(np.diff(pixel)) + 1), len(x)]):
        part = y[begin:stop]
        gap = np.isnan(part)
        if gap.any():
            keep.add(int(begin + np.argmax(gap)))
        if not gap.all():
            keep |= {int(begin + np.nanargmin(part)), int(begin + np.nanargmax(part))}
    kept = sorted(keep)
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


def _path(parts: Sequence[Sequence[tuple[float, float]]], x_scale: _Scale, y_scale: _Scale, place: int) -> str:
    path = "".join("M" + "L".join(f"{x_scale(a):.1f},{y_scale(b):.1f}" for a, b in part) for part in parts)
    return f'<path d="{path}" fill="none" stroke-width="1.5" style="stroke:{_colour(place)}"/>'


def _legend(names: Sequence[str]) -> list[str]:
    parts, x = [], float(LEFT)
    for place, name in enumerate(names):
        parts.append(
            f'<rect x="{x:.1f}" y="28" width="10" height="10" style="fill:{_colour(place)}"/>'
            + _text(name, x + 14, 37, "start")
        )
        x += 30 + 6.5 * len(name)
    return parts


def _told(kind: str, series: Sequence[Series], y_label: str) -> str:
    each = []
    for one in series:
        ends = _extremes(_points(one)[1])
        each.append(f"{one.name} from {ends[0]:.4g} to {ends[1]:.4g}" if ends else f"{one.name} without a value")
    return f"{kind}{f' of {y_label}' if y_label else ''}: {'; '.join(each) or 'none'}."


def _svg(title: str, description: str, body: Iterable[str], height: float = HEIGHT) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" viewBox="0 0 {WIDTH} {height:g}" width="{WIDTH}" '
        f'height="{height:g}" font-family="system-ui,sans-serif" font-size="12">'
        f"<title>{escape(title)}</title><desc>{escape(description)}</desc>"
        f'<text x="4" y="18" font-size="14" font-weight="600" style="fill:{_INK}">{escape(title)}</text>'
        f"{''.join(body)}</svg>"
    )


def _text(text: str, x: float, y: float, anchor: str, full: str = "") -> str:
    more = f"<title>{escape(full)}</title>" if full else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" style="fill:{_INK}">{escape(text)}{more}</text>'
        if text
        else ""
    )


def _cell(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _colour(place: int) -> str:
    place %= len(_COLOURS)
    return f"var(--series-{place},{_COLOURS[place]})"
