"""Episodes as a table and as a page."""

from collections.abc import Sequence
from html import escape

from wetwell.protocols.messages.history import Episode
from wetwell.protocols.messages.verdict import Severity, Stage
from wetwell.protocols.timestamps import to_iso
from wetwell.services.reports.charts import Section, page, paragraph, table
from wetwell.services.reports.charts.axes import Scale, time_ticks
from wetwell.services.reports.charts.svg import GRID, LEFT, RIGHT, WIDTH, colour, legend, svg, text_at
from wetwell.services.reports.severity_words import severity_words
from wetwell.services.reports.tables import named

STAGES: tuple[Stage, ...] = ("watch", "plan", "act")
HEAD, ROW, FOOT = 48, 24, 28
"""Margins and height of a row of the chart. [px]"""
NAMES = 130
"""Room for the names of the assets. [px]"""


def episode_rows(episodes: Sequence[Episode], labels: Sequence[str] = ()) -> list[dict[str, object]]:
    """One row an episode, for people; where `labels` say what they call the pumps, that stands beside a number.

    Examples
    --------
    >>> severity = Severity(quantity="friction_rise_percent", value=16.2, interval=(15.5, 16.9), limit=15.0)
    >>> episode_rows([Episode(time=0, station="s", asset="main", state="system_fault", stage="act", since=0,
    ...     severity=severity, advice="flush the main", cost=1306.8)])
    ... # doctest: +NORMALIZE_WHITESPACE
    [{'asset': 'main', 'state': 'system_fault', 'stage': 'act', 'from': '1970-01-01T00:00:00Z', 'to': 'stands',
      'severity': 'friction 16.2 % (15.5 to 16.9), limit 15 %', 'cost': 1306.8, 'advice': 'flush the main'}]
    """
    return [
        {
            "asset": named(episode.asset, labels),
            "state": episode.state,
            "stage": episode.stage,
            "from": to_iso(episode.since),
            "to": "stands" if episode.to is None else to_iso(episode.to),
            "severity": _severity(episode.severity),
            "cost": "" if episode.cost is None else episode.cost,
            "advice": episode.advice,
        }
        for episode in episodes
    ]


def episode_page(station: str, episodes: Sequence[Episode], first_ns: int, last_ns: int) -> str:
    """Self-contained HTML page of the episodes of a recording.

    Parameters
    ----------
    station : str
    episodes : sequence of Episode
    first_ns, last_ns : int
        What was judged.
    """
    judged = paragraph(f"Judged: {to_iso(first_ns)} to {to_iso(last_ns)}.")
    rows = episode_rows(episodes)
    if not rows:
        return page(f"Episodes of station {station}", [Section("Episodes", judged + paragraph("No fault was told."))])
    listed = table(list(rows[0]), [list(row.values()) for row in rows])
    drawn = episode_chart(episodes, first_ns, max(last_ns, first_ns + 1))
    return page(f"Episodes of station {station}", [Section("Episodes", judged + drawn + listed)])


def episode_chart(episodes: Sequence[Episode], first_ns: int, last_ns: int) -> str:
    """SVG with a row an asset and a bar an episode, in the colour of its stage."""
    assets = list(dict.fromkeys(episode.asset for episode in episodes))
    scale = Scale(float(first_ns), float(last_ns), LEFT + NAMES, WIDTH - RIGHT)
    foot = HEAD + ROW * len(assets)
    body = [text_at(asset, LEFT + NAMES - 8, HEAD + ROW * (place + 0.6), "end") for place, asset in enumerate(assets)]
    for at_ns, words in time_ticks(first_ns, last_ns):
        x = scale(at_ns)
        body.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{HEAD}" y2="{foot}" style="stroke:{GRID}"/>')
        body.append(text_at(words, x, foot + 16, "middle"))
    for episode in episodes:
        left = scale(max(episode.since, first_ns))
        right = scale(last_ns if episode.to is None else episode.to)
        y = HEAD + ROW * assets.index(episode.asset) + 4
        told = f"{episode.asset}: {episode.stage}, {_severity(episode.severity)}"
        body.append(
            f'<rect class="bar" x="{left:.1f}" y="{y}" width="{max(right - left, 2.0):.1f}" height="{ROW - 8}" '
            f'style="fill:{colour(STAGES.index(episode.stage))}"><title>{escape(told)}</title></rect>'
        )
    what = f"{len(episodes)} episodes of {', '.join(assets)}."
    return svg("What stood at fault", what, [*body, *legend(STAGES)], foot + FOOT)


def _severity(severity: Severity | None) -> str:
    return "" if severity is None else severity_words(severity)
