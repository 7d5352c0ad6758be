import math
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from wetwell.services.reports.charts import (
    Section,
    Series,
    Span,
    bar_chart,
    heat_map,
    line_chart,
    page,
    paragraph,
    scatter,
    table,
)
from wetwell.services.reports.charts.svg import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH

SVG = "{http://www.w3.org/2000/svg}"
HOUR_NS = 3_600_000_000_000


def parsed(text: str) -> ET.Element:
    return ET.fromstring(text)  # noqa: S314 - written by the code under test


def path_points(svg: str) -> list[list[tuple[float, float]]]:
    paths = [p.get("d", "") for p in parsed(svg).iter(f"{SVG}path")]
    return [
        [tuple(map(float, point.split(","))) for point in re.split("[ML]", path) if point]  # type: ignore[misc]
        for path in paths
    ]


def texts(svg: str) -> list[str]:
    return [element.text or "" for element in parsed(svg).iter(f"{SVG}text")]


def test_corners_of_the_data_land_on_the_corners_of_the_frame() -> None:
    (points,) = path_points(line_chart("t", [Series("a", [0.0, 5.0, 10.0], [0.0, 1.0, 2.0])]))
    middle = ((LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2)
    assert points == [(LEFT, HEIGHT - BOTTOM), middle, (WIDTH - RIGHT, TOP)]


def test_a_gap_breaks_the_line() -> None:
    svg = line_chart("t", [Series("a", [0, 1, 2, 3, 4], [0, 1, math.nan, 1, 0])])
    assert svg.count('d="M') == 1
    path = next(parsed(svg).iter(f"{SVG}path")).get("d", "")
    assert path.count("M") == 2
    assert path.count("L") == 2


@pytest.mark.parametrize(("begin", "step"), [(0, 1), (1_735_689_600 * 10**9, 10**9)])
def test_a_long_series_keeps_its_only_spike_and_its_only_gap(begin: int, step: int) -> None:
    y = np.zeros(86_400)
    y[50_000] = 7.0
    y[20_000] = math.nan
    svg = line_chart("t", [Series("a", begin + step * np.arange(86_400), y)])
    (points,) = path_points(svg)
    assert (WIDTH - LEFT - RIGHT) <= len(points) < 3 * WIDTH
    assert min(y for _, y in points) < min(sorted(y for _, y in points)[1:])
    spike = min(points, key=lambda point: point[1])
    assert spike[0] == pytest.approx(LEFT + 50_000 / 86_399 * (WIDTH - LEFT - RIGHT), abs=1.0)
    assert next(parsed(svg).iter(f"{SVG}path")).get("d", "").count("M") == 2


@pytest.mark.parametrize(
    ("hours", "label"), [(2, "00:15"), (12, "03:00"), (72, "01-01 12:00"), (24 * 7, "01-03"), (24 * 400, "02-26")]
)
def test_times_have_round_ticks(hours: int, label: str) -> None:
    svg = line_chart("t", [Series("a", [0, hours * HOUR_NS], [0, 1])], is_time=True)
    assert label in texts(svg)


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (0.0, 1.0, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (-3.0, 3.0, ["-3", "-2", "-1", "0", "1", "2", "3"]),
        (5.0, 5.0, ["5.0", "5.2", "5.4", "5.6", "5.8", "6.0"]),
    ],
)
def test_values_have_round_ticks(low: float, high: float, ticks: list[str]) -> None:
    svg = line_chart("t", [Series("a", [0.0, 1.0], [low, high])])
    assert [text for text in texts(svg) if re.fullmatch(r"-?[\d.]+", text)][: len(ticks)] == ticks


def test_limits_and_spans_lie_where_they_should() -> None:
    svg = line_chart(
        "t", [Series("a", [0, 10], [0, 1])], limits={"start": 2.0}, spans=[Span("blockage & more", 5.0, 10.0)]
    )
    root = parsed(svg)
    limit = next(line for line in root.iter(f"{SVG}line") if line.get("class") == "limit")
    assert float(limit.get("y1", "")) == TOP
    span = next(rect for rect in root.iter(f"{SVG}rect") if rect.get("class") == "span")
    assert float(span.get("x", "")) == (LEFT + WIDTH - RIGHT) / 2
    assert float(span.get("x", "")) + float(span.get("width", "")) == WIDTH - RIGHT
    assert "blockage & more" in texts(svg)


def test_bars_stand_on_zero_or_hang_from_it() -> None:
    svg = bar_chart("t", ["mon", "tue"], {"a": [2.0, -2.0], "b": [1.0, math.nan]})
    bars = [rect for rect in parsed(svg).iter(f"{SVG}rect") if rect.get("class") == "bar"]
    heights = [float(bar.get("height", "")) for bar in bars]
    assert len(bars) == 3
    assert heights[0] == pytest.approx(2 * heights[1], abs=0.2)
    assert heights[0] == pytest.approx(heights[2], abs=0.2)
    zero = float(bars[0].get("y", "")) + heights[0]
    assert float(bars[2].get("y", "")) == pytest.approx(zero, abs=0.2)


def test_a_heat_map_shades_by_value() -> None:
    svg = heat_map("t", ["normal", "fault"], ["normal", "fault"], [[8, 0], [math.nan, 4]])
    cells = [rect for rect in parsed(svg).iter(f"{SVG}rect") if rect.get("class") == "cell"]
    assert [float(cell.get("fill-opacity", "")) for cell in cells] == [0.6, 0.0, 0.3]
    assert {"8", "0", "4"} <= set(texts(svg))


def test_dots_land_where_they_should() -> None:
    svg = scatter("t", [Series("a", [0, 4], [0, 4])], lines=[Series("same", [0, 4], [0, 4])])
    dots = [(float(c.get("cx", "")), float(c.get("cy", ""))) for c in parsed(svg).iter(f"{SVG}circle")]
    assert dots == path_points(svg)[0]
    assert dots[1] == (WIDTH - RIGHT, TOP)


@pytest.mark.parametrize(
    "svg",
    [
        line_chart("Level & <inflow>", [Series("a", [], [])]),
        line_chart("Level & <inflow>", []),
        scatter("Level & <inflow>", [Series("a", [1.0], [math.nan])]),
        bar_chart("Level & <inflow>", [], {}),
        bar_chart("Level & <inflow>", ["x"], {"a": [math.nan]}),
        heat_map("Level & <inflow>", ["x"], ["y"], [[math.nan]]),
        heat_map("Level & <inflow>", [], [], np.zeros((0, 0))),
    ],
)
def test_a_chart_without_data_is_still_a_chart_that_says_what_it_is(svg: str) -> None:
    root = parsed(svg)
    assert [root[0].tag, root[1].tag] == [f"{SVG}title", f"{SVG}desc"]
    assert root[0].text == "Level & <inflow>"
    assert root[1].text
    assert "nan" not in svg
    assert "inf," not in svg


@pytest.mark.parametrize(
    ("draw", "said"),
    [
        (lambda: line_chart("t", [Series("a", [1, 2], [1])]), "series 'a'"),
        (lambda: bar_chart("t", ["x"], {"a": [1, 2]}), "group 'a'"),
        (lambda: heat_map("t", ["x"], ["y"], [[1, 2]]), "values"),
    ],
)
def test_shapes_that_do_not_fit_are_named(draw, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        draw()


def test_a_page_is_well_formed_and_fetches_nothing() -> None:
    chart = line_chart("Level", [Series("a", [0, 1], [0, 1])])
    html = page("Report <1>", [Section("A & B", chart + table(["x"], [[None], [1.5], ["<b>"]]) + paragraph("a < b"))])
    root = parsed(html.removeprefix("<!DOCTYPE html>\n"))
    assert [cell.text for cell in root.iter("td")] == ["–", "1.5", "<b>"]
    assert root.find("body/main/h1").text == "Report <1>"
    assert not re.search(r"<script|<link|<img|url\(|@import|src=|href=", html)
    assert "--ink: light-dark(" in html
