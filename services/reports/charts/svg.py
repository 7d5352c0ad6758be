"""Parts of an SVG chart: its frame, its words, its colours."""

from collections.abc import Iterable, Sequence
from html import escape

WIDTH, HEIGHT = 760, 300
LEFT, RIGHT, TOP, BOTTOM = 64, 36, 44, 48
"""Size of a chart, and margins of its axes. [px]."""
PENS = ("#22506e", "#7a5a1e", "#5c4b80", "#2f6a58", "#9a3b4c", "#4d565f")
"""Colours of a chart that stands alone; in a page, those of `theme.css`."""
INK, MUTED, GRID = "var(--ink,#1c2126)", "var(--muted,#4d565f)", "var(--soft,#ced3d7)"


def svg(title: str, description: str, body: Iterable[str], height: float = HEIGHT, width: int = WIDTH) -> str:
    """Whole chart, with what is read to those who cannot see it."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" viewBox="0 0 {width} {height:g}" width="{width}" '
        f'height="{height:g}" font-family="system-ui,sans-serif" font-size="12">'
        f"<title>{escape(title)}</title><desc>{escape(description)}</desc>"
        f'<text x="4" y="18" font-size="14" font-weight="600" style="fill:{INK}">{escape(title)}</text>'
        f"{''.join(body)}</svg>"
    )


def text_at(text: str, x: float, y: float, anchor: str, full: str = "") -> str:
    """Words at a place; `full` is shown where they are cut short."""
    more = f"<title>{escape(full)}</title>" if full else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" style="fill:{INK}">{escape(text)}{more}</text>'
        if text
        else ""
    )


def legend(names: Sequence[str]) -> list[str]:
    """Names of the series beside their colours, above the chart."""
    parts, x = [], float(LEFT)
    for place, name in enumerate(names):
        parts.append(
            f'<rect x="{x:.1f}" y="28" width="10" height="10" style="fill:{colour(place)}"/>'
            + text_at(name, x + 14, 37, "start")
        )
        x += 30 + 6.5 * len(name)
    return parts


def colour(place: int) -> str:
    """Colour of a series by its place."""
    place %= len(PENS)
    return f"var(--pen{place + 1},{PENS[place]})"
