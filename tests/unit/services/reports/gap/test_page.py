"""The page of a diagnosis, of a true diagnosis of a short recording."""

import re
from xml.etree import ElementTree as ET

import pytest

from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.services.reports.gap.page import gap_page
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

STATION = Station.model_validate(
    {"name": "north", "sump": {"area_m2": 8.0}, "pump": [{"curve": [36.0, -0.02333, -1.3333e-4]}] * 2}
)
TRIED = ["friction_bias", "pump_wear", "common_header"]


def page_of(station, tried=TRIED):
    recording = Simulation(station, Scenario(name="day"), 5).advance(21_600, truth=False)
    diagnosis = diagnose(recording, STATION, only=tried)
    report = diagnosis.report()
    text = gap_page(report, diagnosis)
    ET.fromstring(text.partition("\n")[2])  # noqa: S314 - written by the code under test; well-formed
    return report, re.sub(r"\s+", " ", re.sub(r"<style>.*?</style>|<[^>]+>", " ", text))


@pytest.fixture(scope="module")
def rough_main():
    effect = EffectTable.model_validate({"name": "friction_bias", "factor": 1.3})
    return page_of(STATION.model_copy(update={"effect": (effect,)}))


def test_the_first_sentence_says_what_where_how_large_and_how_sure(rough_main):
    report, text = rough_main
    assert report.verdict == "effect"
    first = text[text.index("What it says") :]
    assert re.match(
        r"What it says In the rising main of station north there is friction bias \(factor 1\.\d+, 95 % interval "
        r"1\.\d+ to 1\.\d+; loss exponent [\d.]+, 95 % interval [\d.]+ to 2\), with a probability "
        r"of .*?%: at full speed it has flow [\d.]+ m³/h \([\d.]+ %\) "
        r"lower and head [\d.]+ m \([\d.]+ %\) higher than its simulator says\. What to do: ",
        first,
    )


def test_what_is_too_small_to_matter_is_no_answer_and_told_with_its_size():
    effects = [{"name": "friction_bias", "factor": 1.3}, {"name": "water_inertia", "inertia_s2_m2": 150.0}]
    tables = tuple(map(EffectTable.model_validate, effects))
    report, text = page_of(STATION.model_copy(update={"effect": tables}), [*TRIED, "water_inertia"])
    assert [one.name for one in report.companions] == ["water_inertia"]
    assert "Each station has some water inertia, and here that is no answer." in text
    assert "inertia" not in text[: text.index("How sure that is")]
    assert re.search(r"water inertia inertia s2 m2 1\d\d\.\d+ [\d.]+ to \d+\.?\d* s²/m²", text)


def test_then_come_probabilities_pictures_and_what_was_not_tested_and_statistics_last(rough_main):
    report, text = rough_main
    places = [
        text.index(heading)
        for heading in (
            "How sure that is",
            "Probability of each answer",
            " at full speed, running alone",
            "Level in the wet well",
            "Parameters",
            "What was not tested",
            "common header",
            "How the answer was found, in numbers",
            "Share of the gap that each effect closes alone",
        )
    ]
    assert places == sorted(places)
    assert [one.effect for one in report.not_tested] == ["common_header"]
    assert "system curve, diagnosed" in text
    assert "pump curve, diagnosed" not in text


def test_no_name_of_a_column_or_effect_is_left_as_the_code_has_it(rough_main):
    assert re.findall(r"\b[a-z0-9]+_[a-z0-9_]+\b", rough_main[1]) == []


def test_what_to_do_is_followed_by_the_acts_only_where_there_are_some(rough_main):
    report, text = rough_main
    assert not report.experiments
    assert "Which acts would tell more" not in text


def test_a_station_as_its_file_says_has_no_parameters_to_show():
    report, text = page_of(STATION)
    assert report.verdict == "none"
    assert "Station north runs as its simulator says, but for what does not matter, with a probability of" in text
    assert "Parameters" not in text
    assert "no difference that matters" in text
