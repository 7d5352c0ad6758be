"""Which asset is told at fault, in which quantity, and what costs make of it."""

import math

import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.inference.asset_belief import AssetBelief
from wetwell.detector.verdict.asset_faults import AssetFaults, StageRules
from wetwell.protocols.station.costs import Costs
from wetwell.protocols.station.limits import Limits
from wetwell.services.stations import find_station

ALPHA = datasheet_of(find_station("alpha"))


def belief(size, deviation=0.001, **fields):
    asset = AssetBelief(since_ns=7, told_size=abs(size), flow_m3h=200.0, friction_m=24.0, **fields)
    asset.track.time_ns = 0
    asset.track.mean[:, 0] = size
    asset.track.covariance[:, 0, 0] = deviation**2
    return asset


def told(pump=None, main=None, meters=None, rules=None):
    faults = AssetFaults(1, ALPHA, rules or StageRules())
    return faults.told(pump or AssetBelief(), main or AssetBelief(), meters or {})


def test_nothing_stands_where_nothing_was_told():
    assert told() == ()


def test_the_worst_comes_first_and_each_asset_once():
    faults = told(belief(0.2), belief(0.2), {"pump2_flow_m3h": (5, math.nan, math.nan)})
    assert [(fault.asset, fault.stage) for fault in faults] == [
        ("main", "act"),
        ("sensor:pump2_flow_m3h", "plan"),
        ("pump:2", "watch"),
    ]
    assert faults[0].severity.quantity == "friction_rise_percent"
    assert faults[0].severity.value == pytest.approx(20.0)
    assert [fault.since for fault in faults] == [7, 5, 7]


def test_a_pump_is_told_by_the_limit_that_is_nearer():
    (fault,) = told(belief(1.4))
    assert (fault.severity.quantity, fault.stage) == ("wear_head_percent", "act")
    assert fault.severity.value == pytest.approx(100.0 * 1.4 / 26.0, rel=0.01)
    (fault,) = told(belief(1.4), rules=StageRules(Limits(wear_head_percent=20.0)))
    assert (fault.severity.quantity, fault.stage) == ("speed_loss_percent", "plan")


def test_a_lift_is_told_where_runs_at_several_flows_say_so():
    (fault,) = told(main=belief(0.05, log_static=4.0))
    assert (fault.severity.quantity, fault.stage) == ("static_head_rise_m", "act")
    assert fault.severity.value == pytest.approx(1.2)


@pytest.mark.parametrize(("call_out", "stage"), [(100.0, "plan"), (5000.0, "act")])
def test_costs_decide_between_plan_and_act(call_out, stage):
    rules = StageRules(costs=Costs(call_out=call_out))
    (fault,) = told(main=belief(0.1), rules=rules)
    assert fault.stage == stage


@pytest.mark.parametrize("call_out", [0.0, 5000.0])
def test_costs_do_not_lift_the_limit_nor_lower_it_under_its_half(call_out):
    rules = StageRules(costs=Costs(call_out=call_out))
    assert told(main=belief(0.2), rules=rules)[0].stage == "act"
    assert told(main=belief(0.03), rules=rules)[0].stage == "watch"


def test_a_meter_that_is_off_goes_by_its_limit():
    (fault,) = told(meters={"pump2_head_m": (5, 0.08, 0.005)})
    assert (fault.stage, fault.severity.quantity, fault.severity.value) == ("act", "meter_error_percent", 8.0)
