"""A station without head sensors: that pump or main has moved shows, and the other pumps show which of them."""

from dataclasses import replace

import numpy as np
import pytest
from judging import verdicts_on

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import blocks
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOUR_S = 3600
BEGIN_S, GROWN_S = 8 * HOUR_S, 9 * HOUR_S
HELD = {"start_s": BEGIN_S, "end_s": GROWN_S, "after": "hold"}
BLOCKED = Blockage(pump=2, speed_loss=0.1, **HELD)
CLOGGED = PipeClogging(friction_rise=0.25, **HELD)
BLOCKED_PERCENT = 23.5
"""Of the head at its duty point that a loss of a tenth of the speed takes."""


def recorded(station, *faults, hours=13, has_head=False):
    recording = Simulation(station, Scenario(name="s", fault=faults), 3).advance(hours * HOUR_S)
    columns = {name: values for name, values in recording.columns.items() if has_head or not name.endswith("head_m")}
    return replace(recording, columns=columns)


def with_pumps(station, pumps):
    parts = station.model_dump(exclude_none=True)
    control = {"start_levels_m": [1.6, 1.9][:pumps], "stop_levels_m": [0.5, 0.6][:pumps]}
    return Station.model_validate(parts | {"pump": parts["pump"][:pumps], "control": control})


def told_on(station, recording):
    detector = Detector(station.name, datasheet_of(station))
    return [*verdicts_on(detector, recording), *detector.finish()]


def late_states(verdicts, recording, pump):
    """States that are told of a pump once a fault has grown and each pump has run with it."""
    late_ns = recording.time_ns[0] + (GROWN_S + HOUR_S) * NS_PER_S
    return {verdict.state for verdict in verdicts if verdict.pump == pump and verdict.time > late_ns}


def sizes(verdicts):
    """Of the faults that stand, as told last. [%]."""
    return {fault.asset: fault.severity.value for verdict in verdicts for fault in verdict.faults}


@pytest.mark.parametrize(
    ("fault", "expected"),
    [(BLOCKED, ["normal", "pump_fault", "normal"]), (CLOGGED, ["system_fault"] * 3)],
    ids=["blockage", "clogging"],
)
def test_the_other_pumps_tell_a_fault_of_one_from_one_of_the_main(alpha, fault, expected):
    recording = recorded(alpha, fault)
    verdicts = told_on(alpha, recording)
    assert [late_states(verdicts, recording, pump) for pump in (1, 2, 3)] == [{state} for state in expected]
    (last,) = [verdict for verdict in verdicts if verdict.pump == 2][-1:]
    assert last.evidence["missing"] == ["head_m"]
    assert not {"f_test", "tangent", "index"} & last.evidence.keys(), "they set the head against the flow"
    ((name, severity),) = list(last.evidence["severity"].items())[:1]
    true_percent = {"speed_loss_percent": 10.0, "friction_rise_percent": 25.0}[name]
    assert severity["value"] == pytest.approx(true_percent, abs=1.0)


@pytest.mark.parametrize(
    "has_head", [False, pytest.param(True, marks=pytest.mark.long)], ids=["without head", "with head"]
)
@pytest.mark.parametrize(
    ("fault", "expected"),
    [(BLOCKED, ["normal", "pump_fault"]), (CLOGGED, ["system_fault"] * 2)],
    ids=["blockage", "clogging"],
)
def test_what_the_pumps_have_told_stays_told_for_days_while_what_they_show_stays(alpha, fault, expected, has_head):
    station = with_pumps(alpha, 2)
    recording = recorded(station, fault, hours=72, has_head=has_head)
    verdicts = told_on(station, recording)
    assert [late_states(verdicts, recording, pump) for pump in (1, 2)] == [{state} for state in expected]
    late = [verdict for verdict in verdicts if verdict.state == expected[1]][-20:]
    assert min(verdict.probability[verdict.state] for verdict in late) > 0.95
    ((asset, value),) = sizes(late[-1:]).items()
    assert value == pytest.approx({"main": 25.0, "pump:2": BLOCKED_PERCENT}[asset], rel=0.02)


@pytest.mark.parametrize("pumps", [2, 3])
def test_a_main_that_clogs_later_is_told_beside_a_pump_that_is_blocked(alpha, pumps):
    station = alpha if pumps == 3 else with_pumps(alpha, 2)
    clogged = CLOGGED.model_copy(update={"start_s": 20 * HOUR_S, "end_s": 21 * HOUR_S})
    recording = recorded(station, BLOCKED, clogged, hours=36)
    verdicts = told_on(station, recording)
    last = {verdict.pump: verdict for verdict in verdicts}
    assert last.pop(2).state == "pump_and_system_fault"
    assert {verdict.state for verdict in last.values()} == {"system_fault"}
    assert sizes(verdicts[-pumps:]) == pytest.approx({"pump:2": BLOCKED_PERCENT, "main": 25.0}, rel=0.05)


def test_a_main_that_is_flushed_after_days_is_told_as_clean_by_the_next_runs(alpha):
    cleared = CLOGGED.model_copy(update={"end_s": 50 * HOUR_S, "after": "clear"})
    recording = recorded(alpha, cleared, hours=54)
    verdicts = told_on(alpha, recording)
    clean_ns = recording.time_ns[0] + 51 * HOUR_S * NS_PER_S
    assert {verdict.state for verdict in verdicts if verdict.time > clean_ns} == {"normal"}
    assert verdicts[-1].faults == ()


def test_a_pump_that_is_alone_on_its_main_is_told_to_have_moved_and_no_crew_is_chosen(alpha):
    alone = with_pumps(alpha, 1)
    recording = recorded(alone, Blockage(pump=1, speed_loss=0.1, **HELD))
    verdicts = told_on(alone, recording)
    assert late_states(verdicts, recording, 1) == {"unknown"}
    assert "cannot be told apart" in verdicts[-1].evidence["advice"]
    assert {verdict.state for verdict in verdicts} == {"learning", "unknown", "normal"}


def test_a_healthy_station_is_normal_and_a_snapshot_goes_on_bit_for_bit(alpha):
    recording = recorded(alpha, hours=10)
    detector, told = Detector(alpha.name, datasheet_of(alpha)), []
    for block in blocks(recording, 3):
        restored = Detector(alpha.name, datasheet_of(alpha))
        restored.restore(detector.snapshot())
        detector = restored
        told += detector.update_block(block)
    assert [v.encode() for v in told] == [v.encode() for v in told_on(alpha, recording)[: len(told)]]
    assert {verdict.state for verdict in told} == {"learning", "unknown", "normal"}
    assert [v.state for v in told].count("unknown") == 3, "the first run of each pump, before its head is missed"


def test_a_head_that_comes_while_learning_begins_the_learning_anew(alpha):
    recording = recorded(alpha, hours=10, has_head=True)
    late = recording.time_ns >= recording.time_ns[0] + 2 * HOUR_S * NS_PER_S
    columns = {
        name: values.copy() if name.endswith("head_m") else values for name, values in recording.columns.items()
    }
    for name, values in columns.items():
        if name.endswith("head_m"):
            values[~late] = float("nan")
    verdicts = told_on(alpha, replace(recording, columns=columns))
    last = [verdict for verdict in verdicts if verdict.pump == 1][-1]
    assert last.state == "normal"
    assert last.evidence["signals"][:3] == ["flow", "head", "frequency"]


def test_a_head_that_is_lost_while_learning_is_waited_for(alpha):
    recording = recorded(alpha, hours=5, has_head=True)
    lost = recording.time_ns >= recording.time_ns[0] + 3 * HOUR_S * NS_PER_S
    columns = {
        name: np.where(lost, np.nan, values) if name.endswith("head_m") else values
        for name, values in recording.columns.items()
    }
    told = [verdict for verdict in told_on(alpha, replace(recording, columns=columns)) if verdict.pump == 1]
    assert told[-1].state == "unknown"
    assert told[-1].evidence["reason"] == "without head_m pump and system cannot be told apart"
