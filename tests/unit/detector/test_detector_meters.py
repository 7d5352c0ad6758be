"""Wrong meters in the whole detector: told as such, and never taken for a fault of pump or main."""

import numpy as np
import pytest

from wetwell.detector.inference.posterior import FAULT_STATES
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.faults.telemetry.sensor_bias import SensorBias
from wetwell.simulator.faults.telemetry.sensor_noise import SensorNoise
from wetwell.simulator.faults.telemetry.sensor_stuck import SensorStuck

FROM_S = 24_100
ALWAYS = {"start_s": FROM_S, "end_s": FROM_S + 1}
FLOW_M3H = 200.0


def states(verdicts, pump):
    """States told of a pump's runs, without the first, which may have begun before the fault."""
    return [verdict.state for verdict in verdicts if verdict.pump == pump][1:]


def no_fault(verdicts):
    return not {verdict.state for verdict in verdicts} & set(FAULT_STATES)


def test_a_healthy_station_stays_normal(judge_after_learning):
    verdicts = judge_after_learning()
    assert len(verdicts) > 12
    assert {verdict.state for verdict in verdicts} == {"normal"}


def test_a_flow_meter_that_is_stuck_at_rest_reads_nothing_and_is_dead(judge_after_learning):
    def dead(columns):
        columns["pump1_flow_m3h"][:] = 0.0

    verdicts = judge_after_learning(change=dead)
    assert no_fault(verdicts)
    assert set(states(verdicts, 1)) == {"sensor_fault"}
    assert set(states(verdicts, 2) + states(verdicts, 3)) == {"normal"}
    (evidence,) = [verdict.evidence for verdict in verdicts if verdict.pump == 1][-1:]
    assert evidence["dead"] == ["pump1_flow_m3h"]


def test_a_flow_meter_that_is_stuck_while_the_pump_runs_is_told(judge_after_learning):
    def held(columns):
        first = int(np.flatnonzero(columns["pump1_running"] > 0)[60])
        columns["pump1_flow_m3h"][first:] = columns["pump1_flow_m3h"][first]

    verdicts = judge_after_learning(change=held)
    assert no_fault(verdicts)
    assert set(states(verdicts, 1)) == {"sensor_fault"}
    assert set(states(verdicts, 2) + states(verdicts, 3)) == {"normal"}


@pytest.mark.parametrize("start_s", [24_100, 24_700, 25_300, 25_900])
def test_a_stuck_flow_meter_of_the_simulator_is_told_whenever_it_sticks(judge_after_learning, start_s):
    stuck = SensorStuck(channel="flow_m3h", pump=1, start_s=start_s, end_s=start_s + 1)
    verdicts = judge_after_learning(stuck)
    assert no_fault(verdicts)
    assert set(states(verdicts, 1)[1:]) == {"sensor_fault"}
    assert set(states(verdicts, 2) + states(verdicts, 3)) == {"normal"}


@pytest.mark.parametrize("share", [-0.15, 0.15])
def test_a_flow_meter_that_is_15_percent_off_is_told_and_nothing_else(judge_after_learning, share):
    verdicts = judge_after_learning(SensorBias(channel="flow_m3h", pump=1, bias=share * FLOW_M3H, **ALWAYS))
    assert no_fault(verdicts)
    told = states(verdicts, 1)
    assert told[-1] == "sensor_fault"
    assert told.count("sensor_fault") >= len(told) - 1
    assert set(states(verdicts, 2) + states(verdicts, 3)) == {"normal"}
    assert f"the flow meter reads {share:+.0%}"[:-2] in [v for v in verdicts if v.pump == 1][-1].evidence["advice"]


def test_a_head_sensor_that_reads_too_much_is_never_a_fault_of_pump_or_main(judge_after_learning):
    verdicts = judge_after_learning(SensorBias(channel="head_m", pump=1, bias=3.0, **ALWAYS))
    assert no_fault(verdicts)
    assert states(verdicts, 1)[-1] == "sensor_fault"
    assert set(states(verdicts, 2) + states(verdicts, 3)) == {"normal"}


@pytest.mark.parametrize("channel", ["head_m", "flow_m3h"])
def test_a_noisy_meter_is_told(judge_after_learning, channel):
    verdicts = judge_after_learning(SensorNoise(channel=channel, pump=2, factor=6.0, **ALWAYS))
    assert no_fault(verdicts)
    assert set(states(verdicts, 2)) == {"sensor_fault"}
    assert set(states(verdicts, 1) + states(verdicts, 3)) == {"normal"}
    assert channel in [verdict for verdict in verdicts if verdict.pump == 2][-1].evidence["noisy"]


@pytest.mark.parametrize("column", ["inflow_m3h", "pump1_power_kw"])
def test_a_witness_that_is_lost_changes_no_verdict(judge_after_learning, column):
    def lose(columns):
        columns[column][:] = np.nan

    verdicts = judge_after_learning(change=lose)
    assert {verdict.state for verdict in verdicts} == {"normal"}


def lose_level(columns):
    columns["level_m"][:] = np.nan


def test_a_lost_level_is_said_and_the_pumps_stay_normal(judge_after_learning):
    verdicts = judge_after_learning(change=lose_level)
    assert {verdict.state for verdict in verdicts} == {"sensor_fault"}
    assert min(verdict.probability["sensor_fault"] for verdict in verdicts) > 0.98
    assert all(verdict.evidence["lost"] == ["level_m"] for verdict in verdicts[3:])
    assert {verdict.onset for verdict in verdicts} == {None}


def test_a_blocked_pump_is_told_without_the_level(judge_after_learning):
    verdicts = judge_after_learning(Blockage(pump=2, speed_loss=0.15, shape="step", **ALWAYS), change=lose_level)
    assert states(verdicts, 2)[-1] == "pump_fault"
    assert not {*states(verdicts, 1), *states(verdicts, 3)} & set(FAULT_STATES)


@pytest.mark.parametrize("quantity", ["flow_m3h", "head_m"])
def test_a_meter_whose_link_is_lost_is_told(judge_after_learning, quantity):
    def lose(columns):
        columns[f"pump1_{quantity}"][:] = np.nan

    verdicts = judge_after_learning(change=lose)
    assert set(states(verdicts, 1)) == {"sensor_fault"}
    assert set(states(verdicts, 2) + states(verdicts, 3)) == {"normal"}


def test_what_clogs_the_main_is_told_of_the_main(judge_after_learning):
    verdicts = judge_after_learning(PipeClogging(friction_rise=0.5, shape="step", **ALWAYS))
    for pump in (1, 2, 3):
        assert set(states(verdicts, pump)) == {"system_fault"}
