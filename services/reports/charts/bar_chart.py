"""Bars side by side."""

from collections.abc import Mapping, Sequence
from html import escape
from math import ceil, isfinite

import numpy as np
from numpy.typing import ArrayLike

from wetwell.services.reports.charts.axes import y_axis
from wetwell.services.reports.charts.svg import BOTTOM, HEIGHT, LEFT, RIGHT, WIDTH, colour, legend, svg, text_at


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
    y_scale, body = y_axis([0.0, *(v for values in heights.values() for v in values)], y_label)
    step = (WIDTH - LEFT - RIGHT) / max(len(categories), 1)
    width = 0.8 * step / max(len(heights), 1)
    every = ceil(len(categories) * 7 * max(map(len, categories), default=1) / (WIDTH - LEFT - RIGHT)) or 1
    for column, category in enumerate(categories):
        left = LEFT + column * step
        if column % every == 0:
            body.append(text_at(category, left + step / 2, HEIGHT - BOTTOM + 16, "middle"))
        for place, (name, values) in enumerate(heights.items()):
            value = float(values[column])
            if not isfinite(value):
                continue
            ends = sorted((y_scale(0.0), y_scale(value)))
            body.append(
                f'<rect class="bar" x="{left + 0.1 * step + place * width:.1f}" y="{ends[0]:.1f}" '
                f'width="{width:.1f}" height="{ends[1] - ends[0]:.1f}" style="fill:{colour(place)}">'
                f"<title>{escape(f'{category}, {name}: {value:g}')}</title></rect>"
            )
    told = f"Bars of {', '.join(heights)}{f' in {y_label}' if y_label else ''} for {len(categories)} categories."
    return svg(title, description or told, [*body, *legend(list(heights))])
