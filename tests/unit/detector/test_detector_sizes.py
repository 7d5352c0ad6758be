"""Sizes of faults through a whole detector: what a verdict calls at fault is as large as its run shows."""

import pytest
from judging import verdicts_on

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

BLOCKAGE = {"kind": "blockage", "pump": 2, "speed_loss": 0.3}
CLOGGING = {"kind": "pipe_clogging", "friction_rise": 0.5, "static_rise_m": 0.3}
SUDDEN = {"start_s": 25_200, "end_s": 27_000}
"""Within one or two runs: an early look tells it before the run ends."""


def verdicts(station, fault, seed):
    assert fault["kind"] in FAULTS
    recording = Simulation(station, Scenario.model_validate({"name": "f", "fault": [fault]}), seed).advance(43_200)
    return verdicts_on(Detector(station.name, datasheet_of(station)), recording)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_pump_that_has_lost_a_third_of_its_speed_is_never_called_small(alpha, seed):
    told = [one for one in verdicts(alpha, BLOCKAGE | SUDDEN, seed) if one.state == "pump_fault" and one.pump == 2]
    large = [one for one in told if one.evidence["severity"]["speed_loss_percent"]["value"] > 20.0]
    assert any(one.evidence.get("early") for one in told)
    assert len(large) > 2
    for verdict in large:
        (fault,) = [fault for fault in verdict.faults if fault.asset == "pump:2"]
        assert fault.severity.value > 2.0 * fault.severity.limit
        assert fault.stage == "act"


@pytest.mark.parametrize("seed", [4, 5])
def test_a_main_that_clogs_suddenly_is_as_large_as_its_runs_show(alpha, seed):
    told = [one for one in verdicts(alpha, CLOGGING | SUDDEN, seed) if one.state == "system_fault"]
    full = [one for one in told if one.evidence["severity"]["friction_rise_percent"]["value"] > 40.0]
    assert len(full) > 2
    for verdict in full:
        (fault,) = [fault for fault in verdict.faults if fault.asset == "main"]
        assert fault.severity.value > fault.severity.limit
