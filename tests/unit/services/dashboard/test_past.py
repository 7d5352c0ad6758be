"""What the page draws of the past: bands of verdicts and alarms, short columns, and causes for the overview."""

import json

import pytest

from wetwell.protocols.messages.history import History
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.dashboard.past.bands import alarm_bands, verdict_bands
from wetwell.services.dashboard.past.trends import trends_text
from wetwell.services.dashboard.view.cause import worst_cause


def change(time, pump, state):
    return {"time": time, "pump": pump, "state": state}


def test_bands_of_each_pump_follow_one_another_and_the_last_is_open():
    changes = [
        change("1", 1, "learning"),
        change("2", 2, "learning"),
        change("3", 1, "normal"),
        change("4", 1, "unknown"),
    ]
    bands = [(band["pump"], band["state"], band["from"], band["to"]) for band in verdict_bands(changes)]
    assert bands == [
        (1, "learning", "1", "3"),
        (2, "learning", "2", None),
        (1, "normal", "3", "4"),
        (1, "unknown", "4", None),
    ]


def alarm(time, *, is_active, raised="1", returned=None, name="level_high"):
    return {"id": name, "time": time, "priority": "high", "text": "x", "is_active": is_active, "raised": raised} | (
        {"returned": returned} if returned else {}
    )


@pytest.mark.parametrize(
    ("changes", "spans"),
    [
        ([alarm("1", is_active=True), alarm("2", is_active=True)], [("1", None)]),
        ([alarm("1", is_active=True), alarm("4", is_active=False, returned="3")], [("1", "3")]),
        ([alarm("4", is_active=False, returned="3")], [("1", "3")]),
        ([alarm("1", is_active=True), alarm("7", is_active=True, raised="7")], [("1", "7"), ("7", None)]),
        ([alarm("1", is_active=False, raised=None)], []),
    ],
)
def test_an_alarm_is_one_band_from_when_it_was_raised_until_its_condition_goes(changes, spans):
    assert [(band["from"], band["to"]) for band in alarm_bands(changes)] == spans


def test_trends_keep_edges_and_leave_out_what_no_chart_draws():
    names = ("level_m", "level_m_min", "pump2_flow_m3h_max", "pump1_running", "seq", "flow_m3h_of_others")
    history = History(station="a", kind="samples", time=(2_000_000,), columns=dict.fromkeys(names, (1.0,)))
    told = json.loads(trends_text(history))
    assert told == {"time": [2], "columns": {"level_m": [1], "level_m_min": [1], "pump2_flow_m3h_max": [1]}}


def verdict(pump, state, waiting=None, **fields):
    cost = {} if waiting is None else {"cost": {"expected": {"wait": waiting}}}
    evidence = cost | fields.pop("evidence", {})
    return Verdict(
        time=10,
        station="a",
        pump=pump,
        state=state,
        probability={state: 1.0},
        evidence=evidence,
        window=(0, 10),
        **fields,
    )


def test_the_worst_cause_is_the_gravest_and_among_equals_the_dearest_to_wait_for():
    verdicts = [verdict(1, "system_fault", 50.0), verdict(2, "pump_fault", 10.0), verdict(3, "pump_fault", 20.0)]
    assert worst_cause(verdicts)["asset"] == "pump:3"
    assert worst_cause([verdict(1, "normal"), verdict(2, "learning")]) is None


def test_an_earlier_detector_tells_the_asset_by_its_state():
    cause = worst_cause([verdict(2, "system_fault", evidence={"main": "line 1"})])
    assert (cause["asset"], cause["stage"], cause["severity"]) == ("main:line 1", None, None)


def fault(asset, stage, value=1.0):
    severity = {"quantity": "friction_rise_percent", "value": value, "interval": [0.0, 2.0], "limit": 15.0}
    return {"asset": asset, "stage": stage, "since": 3_000_000, "severity": severity}


def test_the_stage_of_an_asset_decides_and_not_the_state_of_the_pump_that_feels_it():
    watched = verdict(1, "pump_and_system_fault", faults=[fault("pump:1", "watch"), fault("main", "watch")])
    acted = verdict(2, "normal", faults=[fault("main", "act", 16.0)])
    cause = worst_cause([watched, acted])
    assert (cause["asset"], cause["stage"], cause["state"], cause["since_ms"]) == ("main", "act", "system_fault", 3)
    assert cause["severity"]["value"] == 16.0
