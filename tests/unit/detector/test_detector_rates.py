"""Feeds from a sample in a second to one in a quarter of an hour, of instants and of means."""

from dataclasses import replace

import numpy as np
import pytest
from judging import verdicts_on

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.inference.posterior import FAULT_STATES
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_scenario
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.simulation import Simulation

DAY_S = 86_400
DAYS = 5
LONG_RUNS_AREA_M2 = 300.0


@pytest.fixture(scope="module")
def slow_station(alpha):
    """A wet well in which a pump runs for hours."""
    table = alpha.model_dump(exclude_none=True)
    return Station.model_validate(table | {"sump": table["sump"] | {"area_m2": LONG_RUNS_AREA_M2}})


@pytest.fixture(scope="module")
def recorded(slow_station):
    fault = Blockage(pump=1, speed_loss=0.2, start_s=3 * DAY_S, end_s=5 * DAY_S, shape="step")
    scenario = find_scenario("nominal").model_copy(update={"fault": (fault,)})
    return Simulation(slow_station, scenario, 7).advance(DAYS * DAY_S, truth=False)


def stored(recording, period_s, value):
    rows = len(recording) // period_s
    last = np.arange(1, rows + 1) * period_s - 1
    columns = {
        name: values[: rows * period_s].reshape(rows, -1).mean(axis=1) if value == "mean" else values[last]
        for name, values in recording.columns.items()
    }
    return replace(recording, time_ns=recording.time_ns[last], columns=columns, value=value)


def judged(recording, station):
    detector = Detector(station.name, datasheet_of(station))
    return detector, [*verdicts_on(detector, recording), *detector.finish()]


@pytest.mark.parametrize("value", ["instant", "mean", "held"])
@pytest.mark.parametrize("period_s", [60, 300, 900])
def test_a_fault_is_told_and_no_other_at_every_rate(recorded, slow_station, period_s, value):
    detector, verdicts = judged(stored(recorded, period_s, value), slow_station)
    assert detector.counts == {"samples": DAYS * DAY_S // period_s}
    begin_ns = int(recorded.time_ns[0]) + 3 * DAY_S * 10**9
    faults = {(verdict.pump, verdict.state) for verdict in verdicts if verdict.state in FAULT_STATES}
    assert faults == {(1, "pump_fault")}
    assert not [verdict for verdict in verdicts if verdict.state in FAULT_STATES and verdict.time < begin_ns]
    healthy = [verdict for verdict in verdicts if verdict.state == "normal" and verdict.time < begin_ns]
    assert {verdict.pump for verdict in healthy} == {1, 2, 3}


def test_cycles_that_are_shorter_than_the_rate_are_unknown_and_not_learnt_for_ever(alpha):
    recorded = Simulation(alpha, find_scenario("nominal"), 3).advance(2 * DAY_S, truth=False)
    _, verdicts = judged(stored(recorded, 900, "instant"), alpha)
    last = {verdict.pump: verdict for verdict in verdicts}
    assert {verdict.state for verdict in last.values()} == {"unknown"}
    assert {verdict.evidence["reason"] for verdict in last.values()} == {
        "no run of the last day had 2 steady rows, with one in 900 s"
    }
    first_day = [verdict for verdict in verdicts if verdict.time < recorded.time_ns[0] + DAY_S * 10**9]
    assert {verdict.state for verdict in first_day} == {"learning"}


def test_a_state_in_the_middle_of_a_slow_feed_goes_on_bit_for_bit(recorded, slow_station):
    whole, datasheet = stored(recorded, 900, "mean"), datasheet_of(slow_station)
    first, second = Detector(slow_station.name, datasheet), Detector(slow_station.name, datasheet)
    samples = list(whole.samples(slow_station.name))
    for sample in samples[:200]:
        first.update(sample)
    second.restore(first.snapshot())
    rest = [[detector.update(sample) for sample in samples[200:]] for detector in (first, second)]
    assert rest[0] == rest[1]
    assert first.snapshot() == second.snapshot()
