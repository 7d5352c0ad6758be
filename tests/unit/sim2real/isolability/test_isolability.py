"""What is known of pump stations without any computation, and what the computation says of it."""

from itertools import combinations

import numpy as np
import pytest

from wetwell.protocols.quantities import SIGNALS
from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.sim2real.isolability.causes import MATERIAL, causes_of
from wetwell.sim2real.isolability.duty_points import DutyPoint, control_points
from wetwell.sim2real.isolability.isolability import TELLING, are_told_apart, isolability, left_beside
from wetwell.sim2real.isolability.signatures import Signature, signatures_of
from wetwell.simulator.effects import effective_parameters
from wetwell.simulator.parameters import plant_parameters

ALL = ("level", "inflow", "flow", "head", "power")
DEEP = {
    "name": "deep",
    "sump": {"area_m2": 8.0},
    "pump": [{"curve": [36.0, -0.02333, -1.3333e-4]}] * 2,
    "rising_main": {"static_head_m": 12.0, "friction_h2_m5": 6e-4},
}


def told(station, *words, points=None):
    found = isolability(station, [SIGNALS[word] for word in words], points)
    return {cause.name: cause for cause in found.causes}


def at(frequency_hz, level_m=1.0, cycle=0):
    return DutyPoint(frequency_hz=frequency_hz, level_m=level_m, inflow_m3h=90.0, cycle=cycle)


@pytest.mark.long
def test_without_head_at_one_duty_point_lift_friction_wear_and_slip_are_one(alpha):
    found = told(alpha, "flow", points=[at((50.0, 0.0, 0.0))])
    assert set(found["static_head_bias"].same_as) >= {"friction_bias", "pump_wear", "motor_slip", "flow_meter_gain"}
    assert not found["head_sensor_offset"].is_visible


@pytest.mark.long
def test_flow_and_head_tell_the_pump_from_the_main_and_from_both_meters(alpha):
    found = told(alpha, "flow", "head")
    pump, main = {"pump_wear", "motor_slip"}, {"friction_bias", "static_head_bias"}
    assert set(found["pump_wear"].same_as) == pump - {"pump_wear"}
    assert set(found["friction_bias"].same_as) == main - {"friction_bias"}
    assert found["flow_meter_gain"].same_as == found["head_sensor_offset"].same_as == ()


def test_a_lift_is_told_from_a_loss_by_speed():
    station = Station.model_validate(DEEP)
    one = told(station, "flow", "head", points=[at((50.0, 0.0)), at((0.0, 50.0))])
    assert "friction_bias" in one["static_head_bias"].same_as
    many = told(station, "flow", "head", points=[at((hz, 0.0)) for hz in (50.0, 45.0, 40.0)])
    assert "friction_bias" not in many["static_head_bias"].same_as


def test_slip_is_told_from_wear_by_speed(alpha):
    fixed = told(alpha, "flow", "head", "power")
    assert fixed["pump_wear"].same_as == ("motor_slip",)
    points = [at((hz, 0.0, 0.0)) for hz in (50.0, 42.0, 34.0, 26.0)]
    assert told(alpha, "flow", "head", "power", points=points)["motor_slip"].same_as == ()


def test_the_gain_of_the_flow_meter_needs_the_balance_or_the_head(alpha):
    assert told(alpha, "flow", "power")["flow_meter_gain"].same_as
    for more in (("level",), ("level", "inflow"), ("head",)):
        assert told(alpha, "flow", *more)["flow_meter_gain"].same_as == ()


def test_inflow_beside_the_meter_needs_meter_and_level(alpha):
    assert told(alpha, "level", "inflow")["unmetered_inflow"].is_visible
    for words in (("level", "flow", "head", "power"), ("inflow", "flow", "head", "power")):
        assert not told(alpha, *words)["unmetered_inflow"].is_visible


def test_a_header_shows_only_where_two_pumps_run(alpha):
    assert not told(alpha, *ALL, points=[at((50.0, 0.0, 0.0)), at((0.0, 50.0, 0.0))])["common_header"].is_visible
    both = told(alpha, "flow", points=[at((50.0, 0.0, 0.0)), at((50.0, 50.0, 0.0))])
    assert both["common_header"].is_visible
    assert not {"friction_bias", "static_head_bias", "pump_wear"} & set(both["common_header"].same_as)


def test_the_form_of_the_wet_well_needs_the_level_at_two_levels(alpha):
    points = [at((hz, 0.0, 0.0), level_m) for level_m in (0.5, 1.6) for hz in (0.0, 50.0)]
    assert not told(alpha, "inflow", "flow", points=points)["sump_area_profile"].is_visible
    assert told(alpha, "level", "inflow", points=points)["sump_area_profile"].is_visible


def test_nothing_is_seen_without_signals_and_no_bias_of_the_level_ever(alpha):
    assert not any(cause.is_visible for cause in told(alpha).values())
    assert told(alpha, *ALL)["sensor_bias level_m"].size < TELLING


def test_more_signals_never_see_less_nor_tell_fewer_apart(alpha):
    words = ("level", "inflow", "flow", "head")
    for size in range(1, len(words)):
        for few in combinations(words, size):
            less, more = told(alpha, *few), told(alpha, *few, "power")
            unseen = {name for name, cause in less.items() if not cause.is_visible}
            for name, cause in less.items():
                assert more[name].size >= cause.size - 1e-6
                assert set(more[name].same_as) <= {*cause.same_as, *unseen}


def test_another_pump_tells_a_fault_of_one_from_one_of_the_main(alpha):
    found = told(alpha, "flow")
    pump, main = {"blockage", "impeller_wear", "wear_ring_leakage"}, {"pipe_clogging", "partly_closed_valve"}
    assert not set(found["blockage"].same_as) & main
    only = told(alpha, "flow", points=[at((50.0, 0.0, 0.0))])
    assert set(only["blockage"].same_as) >= (pump | main) - {"blockage"}


def test_what_the_station_file_holds_already_is_not_seen_again(alpha):
    joined = alpha.model_copy(update={"effect": (EffectTable.model_validate({"name": "common_header"}),)})
    assert told(alpha, "flow")["common_header"].is_visible
    assert told(joined, "flow")["common_header"].size == pytest.approx(0.0, abs=1e-6)


def test_a_lift_that_follows_the_level_already_may_follow_it_more_and_power_by_load_take_another_form():
    tunnel = {
        "name": "tunnel",
        "sump": {"volume_points": [[0.0, 350.0], [2.0, 6800.0], [4.0, 20000.0]]},
        "pump": [{"curve": [45.0, 0.0, -5e-6]}, {"curve": [45.0, 0.0, -1.2e-6]}],
        "rising_main": {"delivery_level_m": 30.0, "friction_h2_m5": 1.2e-7, "layout": "common"},
        "control": {"mode": "external"},
        "electrical": {"rated_current_a": 400.0, "power_model": "load"},
    }
    found = told(Station.model_validate(tunnel), "flow", "power", "level")
    assert 50.0 < found["level_dependent_static_head"].size < 1000.0
    assert found["static_head_bias"].same_as == ()
    assert found["load_dependent_power"].is_visible


def test_signatures_are_changes_over_noise(alpha):
    plant = plant_parameters(alpha)
    causes = [cause for cause in causes_of(alpha, plant) if cause.name in {"flow_meter_gain", "head_sensor_offset"}]
    points = [at((50.0, 0.0, 0.0))]
    gain, offset = signatures_of(plant, alpha, points, causes, ["flow_m3h", "head_m"])
    many = np.sqrt(points[0].values)
    assert gain.columns[:, 0] == pytest.approx([MATERIAL / alpha.sensors.flow_noise * many, 0.0])
    flow_m3h = plant.pumps[0].rated_flow_m3h
    head_m = 2.0 + 6e-4 * flow_m3h**2
    assert offset.columns[:, 0] == pytest.approx([0.0, MATERIAL / alpha.sensors.head_noise * many], rel=1e-3)
    assert head_m == pytest.approx(26.0, abs=1.0)


def test_what_is_left_is_what_the_other_cannot_be_within_its_signs_and_limits(alpha):
    causes = {cause.name: cause for cause in causes_of(alpha, effective_parameters(alpha))}
    friction = Signature(cause=causes["friction_bias"], columns=np.array([[30.0], [0.0]]))
    slip = Signature(cause=causes["motor_slip"], columns=np.array([[-30.0], [0.0]]))
    assert left_beside(friction, slip) == pytest.approx(0.0, abs=1e-6)
    assert left_beside(slip, friction) == pytest.approx(0.0, abs=1e-6)
    inflow = Signature(cause=causes["unmetered_inflow"], columns=np.array([[30.0], [0.0]]))
    assert left_beside(inflow, slip) == pytest.approx(30.0)
    assert are_told_apart(inflow, slip)
    tiny = Signature(cause=causes["friction_bias"], columns=np.array([[1.0], [0.0]]))
    assert left_beside(slip, tiny) == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("control", "speeds"),
    [
        ({"mode": "on_off"}, {0.0, 50.0}),
        ({"mode": "pid", "min_frequency_hz": 40.0}, {0.0, 45.0, 50.0}),
    ],
)
def test_duty_points_are_those_of_the_control(control, speeds):
    station = Station.model_validate(DEEP | {"control": control})
    points = control_points(station, plant_parameters(station))
    assert {hz for point in points for hz in point.frequency_hz} == speeds
    assert {sum(hz > 0.0 for hz in point.frequency_hz) for point in points} == {0, 1, 2}
    assert {point.level_m for point in points} == {0.5, 1.6, 0.8, 1.8}
    for cycle in {point.cycle for point in points}:
        ours = [point for point in points if point.cycle == cycle]
        assert len(ours) == 4
        assert len({point.inflow_m3h for point in ours}) == 1


def test_pumps_of_two_mains_run_in_cycles_of_their_own():
    mains = [
        {"name": name, "static_head_m": 8.0, "friction_h2_m5": 6e-4, "layout": "common"}
        for name in ("north", "south")
    ]
    pumps = [{"curve": [36.0, -0.02333, -1.3333e-4], "main": name} for name in ("north", "north", "south", "south")]
    table = {key: value for key, value in DEEP.items() if key != "rising_main"}
    control = {"start_levels_m": [1.6, 1.8], "stop_levels_m": [0.5, 0.8]}
    station = Station.model_validate(table | {"pump": pumps, "main": mains, "control": control})
    points = control_points(station, plant_parameters(station))
    running = {tuple(hz > 0.0 for hz in point.frequency_hz) for point in points}
    layout = {cause.name: cause for cause in isolability(station, [SIGNALS["flow"]]).causes}["common_header"]
    assert layout.size == pytest.approx(0.0, abs=1e-6)
    assert (True, True, False, False) in running
    assert (False, False, True, True) in running
    assert not any(any(states[:2]) and any(states[2:]) for states in running)
    found = told(station, "flow", "head")
    assert found["friction_bias"].is_visible
