"""Curves for those who draw them: where they lie, how wide their bands are, and when they are published."""

import json

import numpy as np
import pytest
from memory_bus import MemoryBus

from wetwell.detector.curves.datasheet import datasheet_of, duty_flows
from wetwell.detector.detector import Detector
from wetwell.detector.stream.run_state import new_pumps
from wetwell.detector.verdict.station_model import StationModel
from wetwell.protocols.bus.keys import model_key
from wetwell.services.detector.model_publisher import ModelPublisher
from wetwell.services.stations import find_station
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging


def head_at(curve, flow_m3h, values=None):
    return float(np.interp(flow_m3h, curve.flow_m3h, curve.head_m if values is None else values))


def test_before_learning_only_the_datasheet_is_known(alpha) -> None:
    model = StationModel(alpha).message((None, None, None), {}, 0)
    assert model.start_levels_m == (1.6, 1.8, 2.0)
    assert not model.is_common_header
    for pump in model.pumps:
        assert pump.configured_pump.head_m[0] == 36.0
        assert pump.configured_system.head_m[0] == 2.0
        assert (pump.learnt_pump, pump.now_pump) == (None, None)


def test_pumps_bear_their_names_their_main_and_who_shares_it(alpha) -> None:
    twin = find_station("twin")
    model = StationModel(twin).message((None,) * 4, {}, 0)
    assert not model.is_common_header
    assert [pump.name for pump in model.pumps] == ["1.1", "2.1", "1.2", "2.2"]
    assert [pump.main for pump in model.pumps] == ["line 1", "line 2"] * 2
    assert [pump.header for pump in model.pumps] == [(1, 3), (2, 4)] * 2
    lift_m = 14.0 - twin.middle_level_m
    assert [pump.configured_system.head_m[0] for pump in model.pumps] == [pytest.approx(lift_m)] * 4
    plain = StationModel(alpha).message((None,) * 3, {}, 0)
    assert [(pump.name, pump.main, pump.header) for pump in plain.pumps] == [(None, None, ())] * 3


def test_the_learnt_curves_of_a_healthy_station_are_the_datasheets(alpha, learnt) -> None:
    model = StationModel(alpha).message(learnt.baselines, {}, 0)
    datasheet = datasheet_of(alpha)
    duty = new_pumps(datasheet)
    duty["duty_speed"] = (1.0, 0.0, 0.0)
    duty_flows(datasheet.table(), duty, np.nan)
    duty_m3h = float(duty["duty_m3h"][0])
    for pump in model.pumps:
        for known, datasheet in (
            (pump.learnt_pump, pump.configured_pump),
            (pump.learnt_system, pump.configured_system),
        ):
            assert head_at(known, duty_m3h) == pytest.approx(head_at(datasheet, duty_m3h), abs=0.15)
            low, high = head_at(known, duty_m3h, known.low_m), head_at(known, duty_m3h, known.high_m)
            assert low < head_at(datasheet, duty_m3h) < high
            assert high - low < 1.5


@pytest.mark.parametrize(
    ("fault", "component"),
    [
        (Blockage(pump=1, speed_loss=0.2, start_s=25_000, end_s=25_600), "pump"),
        (PipeClogging(friction_rise=0.6, static_rise_m=0.0, start_s=25_000, end_s=25_600), "system"),
    ],
)
def test_a_fault_moves_the_curve_that_it_concerns(alpha, learnt, judge_after_learning, fault, component) -> None:
    told = {verdict.pump: verdict for verdict in judge_after_learning(fault) if "shift_m" in verdict.evidence}
    pump = StationModel(alpha).message(learnt.baselines, told, 0).pumps[0]
    flow_m3h = 170.0  # between the duty points of both faults
    moved_m = {
        "pump": head_at(pump.now_pump, flow_m3h) - head_at(pump.learnt_pump, flow_m3h),
        "system": head_at(pump.now_system, flow_m3h) - head_at(pump.learnt_system, flow_m3h),
    }
    other = {"pump": "system", "system": "pump"}[component]
    assert abs(moved_m[component]) > 3.0
    assert abs(moved_m[other]) < 0.3
    assert (moved_m[component] < 0.0) == (component == "pump")


def test_the_model_is_published_at_the_beginning_and_when_a_run_was_judged(
    alpha, learnt, judge_after_learning
) -> None:
    bus = MemoryBus()
    publisher = ModelPublisher(bus, alpha, Detector(alpha.name, datasheet_of(alpha)))
    first = bus.get(model_key("alpha"))
    assert json.loads(first)["pumps"][0]["learnt_pump"] is None
    verdicts = judge_after_learning(seconds=1_500)
    publisher.update(verdicts[0].model_copy(update={"evidence": {"reason": "begins"}}))
    assert bus.get(model_key("alpha")) is first
    publisher = ModelPublisher(bus, alpha, learnt)
    publisher.update(next(verdict for verdict in verdicts if "shift_m" in verdict.evidence))
    pumps = json.loads(bus.get(model_key("alpha")))["pumps"]
    assert sum(pump["now_pump"] is not None for pump in pumps) == 1
