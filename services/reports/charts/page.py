"""A report as one HTML page that needs no network, in the colours of the control-room page."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files


@dataclass(frozen=True)
class Section:
    """Part of a page: a heading and ready-made HTML (charts, `table`, `paragraph`)."""

    heading: str
    body: str


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


def folded(summary: str, body: str) -> str:
    """Ready-made HTML that a reader opens when it is wanted.

    Examples
    --------
    >>> folded("Statistics", paragraph("r"))
    '<details><summary>Statistics</summary><p>r</p></details>'
    """
    return f"<details><summary>{escape(summary)}</summary>{body}</details>"


def page(title: str, sections: Iterable[Section]) -> str:
    """Self-contained HTML page: no script, no font, no image from elsewhere; also well-formed XML."""
    body = "".join(f"<section><h2>{escape(s.heading)}</h2>{s.body}</section>" for s in sections)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{escape(title)}</title><style>{_style()}</style></head>"
        f"<body><main><h1>{escape(title)}</h1>{body}</main></body></html>\n"
    )


def _cell(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _style() -> str:
    reports = files("wetwell.services") / "reports"
    sheets = (reports / "theme.css", reports / "charts" / "page.css")
    return "".join(sheet.read_text(encoding="utf-8") for sheet in sheets)
