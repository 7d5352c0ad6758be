"""Shaft power of pumps with a datasheet of their own, against lines and sums that are written here a second time."""

import numpy as np
import pytest

from wetwell.protocols.station.station_file import Station
from wetwell.simulator.duty import duty_table
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.power import power_line

CURVE = (40.0, -0.02, -1e-4)
BASE = {"name": "s", "sump": {"area_m2": 8.0}, "rising_main": {"static_head_m": 10.0, "friction_h2_m5": 2e-4}}
LOAD = {"power_model": "load", "motor_efficiency": 0.9, "drive_efficiency": 0.96, "shutoff_power_share": 0.3}


def station(*pumps):
    return Station.model_validate(BASE | {"pump": [{"curve": CURVE} | pump for pump in pumps], "electrical": LOAD})


def shaft_kw(pump, flow_m3h):
    """Of a pump of the plant at nominal speed."""
    share = pump.shutoff_power_share
    return pump.rated_shaft_kw * (share + (1.0 - share) * flow_m3h / pump.rated_flow_m3h)


def test_points_of_power_give_their_least_squares_line():
    points = [(0.0, 8.2), (100.0, 12.1), (200.0, 15.8), (300.0, 20.3)]
    (pump,) = plant_parameters(station({"power_points": points})).pumps
    slope, intercept = np.polyfit(*np.array(points).T, 1)
    for flow_m3h in (0.0, 150.0, 320.0):
        assert shaft_kw(pump, flow_m3h) == pytest.approx(intercept + slope * flow_m3h, rel=1e-12)


def test_a_line_that_would_need_power_to_be_made_at_no_flow_goes_through_nothing():
    assert power_line([(100.0, 2.0), (200.0, 8.0)], 0.4, 200.0)[0] == 0.0


def test_points_of_efficiency_are_points_of_power_on_the_curve():
    """ρ g Q H / η of two points is the line through both."""
    c0, c1, c2 = CURVE
    points = [(150.0, 0.7), (250.0, 0.75)]
    (pump,) = plant_parameters(station({"efficiency_points": points})).pumps
    for flow_m3h, share in points:
        head_m = c0 + c1 * flow_m3h + c2 * flow_m3h**2
        expected_kw = 1000.0 * 9.81 * flow_m3h / 3600.0 * head_m / share / 1000.0
        assert shaft_kw(pump, flow_m3h) == pytest.approx(expected_kw, rel=1e-12)


def test_one_point_gives_the_size_and_the_station_the_slope():
    (pump,) = plant_parameters(station({"power_points": [(200.0, 15.0)]})).pumps
    assert shaft_kw(pump, 200.0) == pytest.approx(15.0)
    assert pump.shutoff_power_share == pytest.approx(LOAD["shutoff_power_share"])


def test_each_pump_has_its_own_power_and_the_others_that_of_the_station():
    plain = plant_parameters(station({}, {})).pumps
    own = plant_parameters(station({}, {"power_points": [(100.0, 30.0), (200.0, 40.0)]})).pumps
    assert own[0] == plain[0]
    assert shaft_kw(own[1], 0.0) == pytest.approx(20.0)


def test_the_duty_table_tells_the_load_with_its_losses():
    """Two per cent of the rated power are lost at any load, so that rated losses are those of the efficiencies."""
    (row,) = duty_table(station({"power_points": [(100.0, 30.0), (200.0, 40.0)]}))["each_pump_alone"]
    expected_kw = 20.0 + 0.1 * row["flow_m3h"]
    assert row["shaft_power_kw"] == pytest.approx(expected_kw, abs=0.01)
    assert row["electrical_power_kw"] == pytest.approx(expected_kw / (0.9 * 0.96), abs=0.01)
