"""Charts as SVG and reports as one HTML page: texts in, texts out.

Colours are CSS variables with a default each, so that a chart stands alone and follows the page's light or dark
scheme. Every chart has a title and a description for screen readers.
"""

from wetwell.services.reports.charts.bar_chart import bar_chart
from wetwell.services.reports.charts.heat_map import heat_map
from wetwell.services.reports.charts.line_chart import Series, Span, line_chart, scatter
from wetwell.services.reports.charts.page import Section, folded, page, paragraph, table
from wetwell.services.reports.charts.share_bars import percent, share_bars

__all__ = [
    "Section",
    "Series",
    "Span",
    "bar_chart",
    "folded",
    "heat_map",
    "line_chart",
    "page",
    "paragraph",
    "percent",
    "scatter",
    "share_bars",
    "table",
]
