"""Bars that lie: as long as their shares, each with its name and its number."""

from xml.etree import ElementTree as ET

import pytest

from wetwell.services.reports.charts import share_bars

SVG = "{http://www.w3.org/2000/svg}"


def drawn(shares):
    return ET.fromstring(share_bars("Probability", shares))  # noqa: S314 - written by the code under test


def widths(svg):
    return [float(bar.get("width")) for bar in svg.iter(f"{SVG}rect") if bar.get("class") == "bar"]


def words(svg):
    return [element.text for element in svg.iter(f"{SVG}text")]


def test_bars_are_as_long_as_their_shares():
    first, second, none = widths(drawn({"a": 0.8, "b": 0.2, "c": 0.0}))
    assert first == pytest.approx(4.0 * second, rel=0.01)
    assert none == 0.0


def test_each_has_its_name_and_its_number():
    assert words(drawn({"pump wear": 0.982, "unknown": 0.0001}))[1:] == ["pump wear", "98.2 %", "unknown", "< 0.1 %"]


def test_what_lies_beyond_is_cut_off_and_a_long_name_is_short_but_whole_for_who_asks():
    name = "friction bias and static head bias and motor slip and level sensor lag"
    svg = drawn({name: 1.7, "b": 1.0, "c": -0.2})
    assert widths(svg)[0] == widths(svg)[1]
    assert widths(svg)[2] == 0.0
    short = next(element for element in svg.iter(f"{SVG}text") if element.find(f"{SVG}title") is not None)
    assert short.text.endswith("…")
    assert short.find(f"{SVG}title").text == name


def test_nothing_to_draw_is_an_empty_picture():
    assert words(drawn({})) == ["Probability"]
