"""Other stations than the paper's in the whole detector, and what an operator may ask of it."""

import copy

import numpy as np
import pytest
from judging import verdicts_on

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.inference.posterior import FAULT_STATES
from wetwell.protocols.timestamps import LEARNING_S, NS_PER_S
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.inflow.surges import Surges
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOUR_S = 3600
DAY_S = 24 * HOUR_S
FROM_NOON = {"shape": "step", "start_s": 12 * HOUR_S, "end_s": 13 * HOUR_S}


def judged(station, recording):
    """Detector after a recording, and verdicts by second since its start."""
    detector, start_ns = Detector(station.name, datasheet_of(station)), int(recording.time_ns[0])
    return detector, [((verdict.time - start_ns) / NS_PER_S, verdict) for verdict in verdicts_on(detector, recording)]


def false_ones(told, until_s):
    alarms = (*FAULT_STATES, "sensor_fault")
    return [verdict.state for second, verdict in told if second < until_s and verdict.state in alarms]


def share_of_normal(told, from_s, until_s):
    states = [verdict.state for second, verdict in told if from_s < second < until_s]
    assert len(states) > 8
    return states.count("normal") / len(states)


def test_a_station_at_varied_speed_has_a_quiet_day_and_then_its_blockage_is_told(alpha):
    control = alpha.control.model_copy(update={"mode": "pid", "min_frequency_hz": 25.0})
    station = alpha.model_copy(update={"control": control})
    blockage = Blockage(pump=2, speed_loss=0.3, shape="step", start_s=DAY_S, end_s=DAY_S + 1)
    recording = Simulation(station, Scenario(name="varied", fault=(blockage,)), 5).advance(28 * HOUR_S)
    speeds_hz = recording.columns["pump1_frequency_hz"]
    assert np.quantile(speeds_hz[speeds_hz > 0], 0.1) < 40.0
    _, told = judged(station, recording)
    assert false_ones(told, DAY_S) == []
    assert share_of_normal(told, 12 * HOUR_S, DAY_S) > 0.95
    after = [verdict for second, verdict in told if second > DAY_S]
    assert {verdict.pump for verdict in after if verdict.state in FAULT_STATES} == {2}
    assert [verdict.state for verdict in after if verdict.pump == 2][-1] == "pump_fault"


@pytest.mark.parametrize(
    ("fault", "pumps", "state"),
    [
        (Blockage(pump=2, speed_loss=0.2, **FROM_NOON), {2}, "pump_fault"),
        (PipeClogging(friction_rise=0.4, **FROM_NOON), {1, 2}, "system_fault"),
    ],
    ids=["pump", "main"],
)
def test_two_pumps_on_a_common_header_are_learnt_together_and_told_apart(alpha, fault, pumps, state):
    station = alpha.model_copy(
        update={
            "rising_main": alpha.rising_main.model_copy(update={"layout": "common"}),
            "pump": alpha.pump[:2],
            "control": alpha.control.model_copy(update={"start_levels_m": (1.6, 1.8), "stop_levels_m": (0.5, 0.8)}),
        }
    )
    inflow = DiurnalInflow(surges=Surges(flow_m3h=120.0))
    recording = Simulation(station, Scenario(name="common", fault=(fault,), inflow=inflow), 4).advance(15 * HOUR_S)
    both = (recording.columns["pump1_running"] > 0) & (recording.columns["pump2_running"] > 0)
    assert both[: 12 * HOUR_S].sum() > 300, "both pumps run at times"
    _, told = judged(station, recording)
    assert false_ones(told, 12 * HOUR_S) == []
    after = [verdict for second, verdict in told if second > 13 * HOUR_S]
    assert {verdict.pump for verdict in after if verdict.state in FAULT_STATES} == pumps
    for pump in pumps:
        states = [verdict.state for verdict in after if verdict.pump == pump]
        assert states.count(state) >= 0.7 * len(states)


def test_flow_meters_that_wander_over_the_day_take_a_day_to_learn_and_then_give_no_alarm(alpha):
    recording = Simulation(alpha, Scenario(name="wander"), 6).advance(34 * HOUR_S)
    seconds = np.arange(len(recording))
    for pump in (1, 2, 3):
        recording.columns[f"pump{pump}_flow_m3h"][:] *= 1.0 + 0.01 * np.sin(2.0 * np.pi * seconds / DAY_S + pump)
    _, told = judged(alpha, recording)
    assert false_ones(told, np.inf) == []
    assert share_of_normal(told, 26 * HOUR_S, np.inf) > 0.95
    ends_s = {}
    for second, verdict in told:
        if verdict.state != "learning":
            ends_s.setdefault(verdict.pump, second)
    assert max(ends_s.values()) < 26 * HOUR_S
    assert max(ends_s.values()) > DAY_S
    assert min(ends_s.values()) > LEARNING_S


@pytest.mark.check
@pytest.mark.parametrize("seed", [92011, *(pytest.param(seed, marks=pytest.mark.long) for seed in (92015, 92016))])
def test_meters_that_wander_beside_slow_noise_give_no_alarm_before_the_day_is_learnt(alpha, seed):
    """What they make of health was carried along as a fault that stays."""
    sensors = alpha.sensors.model_copy(update={"correlation": 0.95})
    recording = Simulation(alpha.model_copy(update={"sensors": sensors}), Scenario(name="slow"), seed).advance(
        2 * DAY_S
    )
    for pump in (1, 2, 3):
        seconds = np.arange(len(recording))
        recording.columns[f"pump{pump}_flow_m3h"][:] *= 1.0 + 0.01 * np.sin(2.0 * np.pi * seconds / DAY_S)
    _, told = judged(alpha, recording)
    assert false_ones(told, np.inf) == []
    assert share_of_normal(told, DAY_S, np.inf) > 0.95


def test_a_station_that_never_had_a_level_is_judged_without(alpha):
    fault = Blockage(pump=3, speed_loss=0.15, shape="step", start_s=8 * HOUR_S, end_s=9 * HOUR_S)
    recording = Simulation(alpha, Scenario(name="bare", fault=(fault,)), 7).advance(10 * HOUR_S)
    for name in ("level_m", "inflow_m3h"):
        recording.columns[name][:] = np.nan
    _, told = judged(alpha, recording)
    assert false_ones(told, 8 * HOUR_S) == []
    after = [verdict for second, verdict in told if second > 8 * HOUR_S]
    assert {verdict.pump for verdict in after if verdict.state in FAULT_STATES} == {3}
    assert {verdict.state for verdict in after if verdict.pump != 3} == {"normal"}


@pytest.fixture(scope="module")
def now_ns(learnt):
    return learnt.seen_until_ns


def test_a_pump_that_is_re_baselined_learns_anew_and_the_others_go_on(alpha, learnt, now_ns):
    detector = copy.deepcopy(learnt)
    verdict = detector.rebaseline(1, now_ns)
    assert (verdict.pump, verdict.state, verdict.evidence["reason"]) == (2, "learning", "re-baselined by an operator")
    recording = Simulation(alpha, Scenario(name="healthy"), 3).advance(24_000 + 24_500)
    told = []
    for n, sample in enumerate(recording.samples(alpha.name)):
        if n >= 24_000:
            told += [(n - 24_000, verdict) for verdict in detector.update(sample)]
    own = [(second, verdict) for second, verdict in told if verdict.pump == 2]
    assert {verdict.state for _, verdict in told if verdict.pump != 2} == {"normal"}
    assert {verdict.state for second, verdict in own if second < LEARNING_S} == {"learning"}
    assert own[-1][1].state == "normal"
    assert own[-1][1].evidence["baseline"] == 2
    back = detector.revert(1, now_ns + 25_000 * NS_PER_S)
    assert (back.pump, back.state) == (2, "unknown")
    assert detector._judges[1].memory.reference.version == 1


def test_what_was_put_aside_can_be_taken_back_before_anything_new_is_learnt(learnt, now_ns):
    detector = copy.deepcopy(learnt)
    before = detector._judges[0].memory.reference
    assert detector.revert(0, now_ns).evidence["reason"] == "no baseline was put aside"
    assert detector._judges[0].memory.reference is before
    detector.rebaseline(0, now_ns)
    verdict = detector.revert(0, now_ns)
    assert verdict.evidence["reason"] == "baseline taken back by an operator"
    assert detector._judges[0].memory.reference is before


def test_a_repaired_pump_is_healthy_again_once_it_is_learnt_anew(alpha):
    """A weak pump is learnt, then exchanged: better than learnt is no fault, and a new baseline settles it."""
    weak = Blockage(pump=1, speed_loss=0.04, shape="step", start_s=0, end_s=8 * HOUR_S, after="clear")
    recording = Simulation(alpha, Scenario(name="exchanged", fault=(weak,)), 8).advance(10 * HOUR_S)
    detector, told = judged(alpha, recording)
    after = [verdict for second, verdict in told if second > 8 * HOUR_S + 1800 and verdict.pump == 1]
    assert {verdict.state for verdict in after} == {"unknown"}
    assert all("re-baseline" in verdict.evidence["advice"] for verdict in after)
    assert detector.rebaseline(0, int(recording.time_ns[-1])).state == "learning"
