"""Lines that the first commands print fit a terminal, with the longest of what they may have to say."""

import pytest

from wetwell.protocols.messages.plant_clock import PlantClock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.doctor.finding import Finding, finding_lines
from wetwell.services.reports.tables import as_lines
from wetwell.services.reports.terminal import WORDS, banner, begin_line, clock_line, story_lines, verdict_line
from wetwell.services.reports.text_table import SCREEN_WIDTH
from wetwell.services.runtime.settings import Settings
from wetwell.services.stations import find_station
from wetwell.services.supervisor.screens import TerminalScreen

NAMES = ("Pumpwerk Süd 1", "Pumpwerk Süd Nord")
ADVICE = "flush the main: look for deposits, air at high points, a valve that is not open"


def verdict(state: str, pump: int = 2, **evidence: object) -> Verdict:
    shift_m = {"pump": -12.34, "system": 12.34}
    return Verdict(
        time=0,
        station="sued",
        pump=pump,
        state=state,
        probability={state: 1.0},
        evidence={"shift_m": shift_m} | evidence,
        onset=0,
        window=(0, 0),
    )


def widest(text: str) -> int:
    return max(map(len, text.splitlines()))


@pytest.mark.parametrize("names", [("1", "2"), NAMES])
@pytest.mark.parametrize("state", WORDS)
def test_a_verdict_fits_with_all_that_it_says(state, names):
    told = verdict(state, reason="the meters of head and flow do not agree with each other; " * 3, advice=ADVICE)
    line = verdict_line(told, names)
    assert widest(line) <= SCREEN_WIDTH
    assert WORDS[state] in line
    assert "pump curve -12.34 m" in line
    assert widest(story_lines([told], 17.8, names)) <= SCREEN_WIDTH


@pytest.mark.parametrize("state", ["normal", "pump_fault", "system_fault", "sensor_fault"])
def test_a_common_verdict_is_one_line_also_in_the_summary(state):
    assert "\n" not in verdict_line(verdict(state), ("1", "2"))
    assert story_lines([verdict(state)], 17.8, ("1", "2")).count(WORDS[state]) == 1
    assert "pump curve" in story_lines([verdict(state)], 17.8, ("1", "2")).splitlines()[1]


def test_the_figures_of_a_long_line_stand_below_its_pump():
    first, second = verdict_line(verdict("pump_and_system_fault"), NAMES).splitlines()
    assert first.index("pump 2 (Pumpwerk Süd Nord)") == second.index("p = 1.000")


def test_the_start_fits():
    said: list[str] = []
    station = find_station("alpha").model_copy(update={"title": "Pumpwerk Süd " * 6})
    screen = TerminalScreen(lambda text, ends: said.append(text + "\n" * ends), "", NAMES)
    screen.greet()
    for part in ("historian", "dashboard", "detector", "alarms", "watch", "simulator"):
        screen.show_ready(part, 43.21)
    for has_keys in (True, False):
        screen.show_begin(has_keys=has_keys)
        assert widest(begin_line(has_keys=has_keys)) <= SCREEN_WIDTH
    clock = PlantClock(station="alpha", seconds=1e7, speed=60, full_speed=600, is_held=True)
    assert widest(clock_line(clock)) <= SCREEN_WIDTH
    assert widest(banner(Settings(), station, "a-scenario-with-a-long-name", 600.0)) <= SCREEN_WIDTH
    assert widest("".join(said)) <= SCREEN_WIDTH


def test_findings_and_plain_results_fit():
    finding = Finding("samples", "error", "station 'alpha': " + "no sample came " * 8, "look at its log " * 12)
    text = finding_lines([finding])
    assert widest(text) <= SCREEN_WIDTH
    assert {line[:20].strip() for line in text.splitlines()[1:]} == {""}
    assert widest(as_lines({"effects": [f"effect_number_{number}" for number in range(20)]})) <= SCREEN_WIDTH
