"""A table whose cells are shaded by value."""

from collections.abc import Sequence
from html import escape
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from wetwell.services.reports.charts.svg import GRID, RIGHT, TOP, WIDTH, colour, svg, text_at


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
    body = [text_at(row_label, 4, TOP + 14, "start"), text_at(column_label, (left + WIDTH) / 2, height - 6, "middle")]
    for j, name in enumerate(columns):
        short = name if len(name) <= fits else name[: max(fits - 1, 1)] + "…"
        body.append(text_at(short, left + (j + 0.5) * cell_width, TOP + 14, "middle", name))
    for i, row in enumerate(rows):
        top = TOP + 20 + i * cell_height
        body.append(text_at(row, left - 6, top + 18, "end"))
        for j, column in enumerate(columns):
            value = float(cells[i, j])
            if not isfinite(value):
                continue
            shade = 0.6 * max(value, 0.0) / most if most > 0.0 else 0.0
            x, number = left + j * cell_width, f"{value:.3g}" if value % 1.0 else f"{value:.0f}"
            body.append(
                f'<rect class="cell" x="{x:.1f}" y="{top}" width="{cell_width:.1f}" height="{cell_height}" '
                f'style="fill:{colour(0)};stroke:{GRID}" fill-opacity="{shade:.3f}">'
                f"<title>{escape(f'{row}, {column}: {value:g}')}</title></rect>"
                f"{text_at(number, x + cell_width / 2, top + 18, 'middle')}"
            )
    told = f"Table of {len(rows)} rows and {len(columns)} columns, shaded by value, greatest {most:g}."
    return svg(title, description or told, body, height)
