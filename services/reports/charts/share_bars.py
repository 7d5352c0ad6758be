"""Shares as bars that lie, each with its name and its number."""

from collections.abc import Mapping
from html import escape

from wetwell.services.reports.charts.svg import GRID, TOP, colour, svg, text_at

ROW = 24
"""Height of a bar with the space around it. [px]."""
WIDE = 460
"""Width of the picture: a phone shows it nearly as it is. [px]."""
LETTER = 6.6
"""Width of a letter. [px]."""
NUMBER = 56
"""Width of the number behind a bar. [px]."""


def share_bars(title: str, shares: Mapping[str, float], *, description: str = "") -> str:
    """SVG with a bar from 0 to 100 % for each share, the name before it and the number behind it.

    Parameters
    ----------
    shares : mapping of str to float
        0..1, by name; drawn in this order, what lies beyond is cut off.

    Examples
    --------
    >>> share_bars("Probability", {"pump wear": 0.9, "unknown": 0.1}).count('class="bar"')
    2
    """
    left = min(16 + LETTER * max(map(len, shares), default=0), WIDE // 2)
    full = WIDE - left - NUMBER
    top = TOP - 10
    body = []
    for place, (name, share) in enumerate(shares.items()):
        y = top + place * ROW
        width = full * min(max(share, 0.0), 1.0)
        number = percent(share)
        fits = int((left - 16) / LETTER)
        short = name if len(name) <= fits else name[: fits - 1] + "…"
        at = f'x="{left:.1f}" y="{y + 4}" height="{ROW - 8}"'
        body.append(
            f"{text_at(short, left - 8, y + 15, 'end', name)}"
            f'<rect {at} width="{full:.1f}" style="fill:{GRID}" fill-opacity="0.5"/>'
            f'<rect class="bar" {at} width="{width:.1f}" style="fill:{colour(0)}">'
            f"<title>{escape(f'{name}: {number}')}</title></rect>"
            f"{text_at(number, left + full + 6, y + 15, 'start')}"
        )
    told = ", ".join(f"{name} {percent(share)}" for name, share in shares.items()) or "none"
    return svg(title, description or f"Bars: {told}.", body, top + ROW * max(len(shares), 1) + 8, WIDE)


def percent(share: float) -> str:
    """A share in words: no more digits than anybody needs, and never 0 or 100 % where it is not.

    Examples
    --------
    >>> [percent(share) for share in (1.0, 0.9996, 0.982, 0.0177, 0.0001, 0.0, -0.25)]
    ['100 %', '> 99.9 %', '98.2 %', '1.8 %', '< 0.1 %', '0 %', '-25.0 %']
    """
    if share in {0.0, 1.0}:
        return f"{share:.0%}".replace("%", " %")
    if share > 0.999:
        return "> 99.9 %"
    return "< 0.1 %" if abs(share) < 0.001 else f"{100.0 * share:.1f} %"
