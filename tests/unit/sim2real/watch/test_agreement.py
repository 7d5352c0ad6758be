"""A gap and a fault are one where the effect is a fault of the asset, at that pump or that meter."""

import pytest

from wetwell.sim2real.diagnosis.report import FittedParameter, FoundEffect
from wetwell.sim2real.watch.agreement import ToldFault, asset_of


def effect(name, component, pump=None):
    parameters = {} if pump is None else {"pump": FittedParameter(value=pump, ci=None, unit="")}
    return FoundEffect(name=name, component=component, equivalent=(), parameters=parameters)


FRICTION = effect("friction_bias", "rising_main")


@pytest.mark.parametrize(
    ("gap", "asset", "is_one"),
    [
        (FRICTION, "main", True),
        (FRICTION, "main:line 1", True),
        (FRICTION, "pump:1", False),
        (effect("pump_wear", "pump", 2), "pump:2", True),
        (effect("pump_wear", "pump", 2), "pump:1", False),
        (effect("pump_wear", "pump", 0), "pump:1", True),
        (effect("motor_slip", "drive", 1), "pump:1", True),
        (effect("flow_meter_gain", "flow_meter"), "sensor:pump2_flow_m3h", True),
        (effect("flow_meter_gain", "flow_meter"), "sensor:pump2_head_m", False),
        (effect("level_sensor_lag", "level_sensor"), "sensor:level_m", True),
        (effect("threshold_shift", "controller"), "main", False),
    ],
)
def test_what_is_one(gap, asset, is_one):
    told = [ToldFault(asset=asset, since_ns=5)]
    assert asset_of(gap, gap.component, told, 0, 10) == (asset if is_one else None)


def test_what_nothing_explains_goes_by_its_component():
    assert asset_of(None, "rising_main", [ToldFault(asset="main", since_ns=0)], 0, 10) == "main"
    assert asset_of(None, "sump", [ToldFault(asset="main", since_ns=0)], 0, 10) is None


@pytest.mark.parametrize(("since", "to", "is_one"), [(0, 5, False), (0, 6, True), (9, None, True), (10, None, False)])
def test_a_fault_counts_while_it_stands(since, to, is_one):
    told = [ToldFault(asset="main", since_ns=since, to_ns=to)]
    assert (asset_of(FRICTION, "rising_main", told, 5, 10) == "main") is is_one
