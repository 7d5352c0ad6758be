"""What holds for all stations with several mains, delivery levels and points of volume."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from wetwell.protocols.station.station_file import Station
from wetwell.protocols.station.sump import Sump
from wetwell.services.stations import find_station
from wetwell.sim2real.replay.kernel import replay_seconds
from wetwell.simulator.duty import duty_flows_m3h
from wetwell.simulator.effects import effective_parameters
from wetwell.simulator.forcing import healthy_forcing
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation
from wetwell.simulator.state import first_state, still_truth
from wetwell.simulator.wet_well import level_at_volume_m, profile_of_slices, volume_at_level_m3

SECONDS = 240
LEVEL_M = 2.0
HUGE_M2 = 1e9
"""Its level does not move, whatever flows."""


def numbers(least, most):
    return st.floats(least, most, allow_nan=False)


def run(station, frequency_hz):
    """(3, pumps, n) flow, head and power of a plant whose drives are driven as they are told."""
    plant, (pumps, seconds) = effective_parameters(station), frequency_hz.shape
    reading = np.zeros((3, pumps, seconds))
    replay_seconds(
        plant.records(),
        first_state(plant, LEVEL_M),
        healthy_forcing(np.zeros(seconds), pumps, len(station.mains)),
        np.zeros((3, 3, pumps)),
        np.ascontiguousarray(frequency_hz),
        np.full(seconds, np.nan),
        np.zeros(seconds),
        np.zeros(seconds),
        np.zeros((2, seconds)),
        1.0,
        np.zeros(seconds, dtype=bool),
        1,
        still_truth(pumps, 1),
        np.empty(seconds),
        reading,
    )
    return reading


@st.composite
def pumps_of_mains(draw):
    """Mains, and pumps with the place of their main, in any order."""
    mains = [
        {
            "name": f"line {place}",
            "static_head_m": draw(numbers(0.0, 9.0)),
            "friction_h2_m5": draw(numbers(0.0, 1e-3)),
            "layout": draw(st.sampled_from(["individual", "common"])),
        }
        for place in range(2)
    ]
    places = draw(st.permutations([0, 1, *draw(st.lists(st.integers(0, 1), max_size=3))]))
    curves = [[draw(numbers(20.0, 60.0)), draw(numbers(-0.05, 0.0)), draw(numbers(-5e-4, -1e-5))] for _ in places]
    return mains, places, curves


RIGID = {"name": "water_inertia", "inertia_s2_m2": 400.0}
LONG = {"wave_s": 2.5}
EFFECTS = [
    {"name": "air_pocket", "head_m": 1.5, "growth_s": 60.0, "purge_s": 20.0, "pocket": "shared"},
    RIGID,
    {"name": "check_valve_leak", "leak_m3h": 3.0},
    {"name": "friction_bias", "factor": 1.3},
    {"name": "static_head_bias", "offset_m": 0.7},
    {"name": "sticking_check_valve", "opening_m": 6.0},
    {"name": "common_header", "shared_fraction": 0.6},
]


@settings(max_examples=25, deadline=None)
@given(pumps_of_mains(), st.sets(st.integers(0, len(EFFECTS) - 1), max_size=3), st.integers(0, 2**16))
def test_two_mains_are_two_stations_with_the_same_pumps(made, chosen, seed):
    """To the byte: flows, heads and powers of one main know nothing of the other."""
    mains, places, curves = made
    effects = [EFFECTS[place] | (LONG if EFFECTS[place] == RIGID and seed % 2 else {}) for place in sorted(chosen)]
    on = np.repeat(np.random.default_rng(seed).random((len(places), SECONDS // 40)) < 0.6, 40, axis=1)
    frequency_hz = np.where(on, 50.0 - 10.0 * np.random.default_rng(seed + 1).random(len(places))[:, None], 0.0)
    base = {
        "name": "s",
        "sump": {"area_m2": HUGE_M2},
        "control": {"mode": "external"},
        "electrical": {"power_model": "load"},
        "effect": effects,
    }
    pumps = [{"curve": curve, "main": mains[place]["name"]} for place, curve in zip(places, curves, strict=True)]
    both = run(Station.model_validate(base | {"main": mains, "pump": pumps}), frequency_hz)
    for place, main in enumerate(mains):
        mine = [number for number, each in enumerate(places) if each == place]
        alone = Station.model_validate(base | {"rising_main": main, "pump": [pumps[number] for number in mine]})
        np.testing.assert_array_equal(both[:, mine], run(alone, frequency_hz[mine]))


@settings(deadline=None)
@given(numbers(0.0, 5.0), numbers(-3.0, 3.0), st.sampled_from(["individual", "common"]), numbers(0.0, 1.5))
def test_a_delivery_level_is_the_static_head_at_that_level(level_m, bias_m, layout, slope):
    """With a bias on it, and the effect of the level on top of that of the delivery level."""
    effects = [
        {"name": "static_head_bias", "offset_m": bias_m},
        {"name": "level_dependent_static_head", "slope": slope, "reference_level_m": 1.0},
    ]
    base = {"name": "s", "sump": {"area_m2": 8.0}, "pump": [{"curve": [40.0, -0.02, -1e-4]}] * 2}
    lifted = base | {"rising_main": {"delivery_level_m": 16.0, "layout": layout}, "effect": effects}
    static_head_m = 16.0 - level_m + bias_m - slope * (level_m - 1.0)
    speed_ratio = np.array([1.0, 0.95])
    flow_m3h = duty_flows_m3h(effective_parameters(Station.model_validate(lifted)), speed_ratio, level_m)
    fixed = base | {"rising_main": {"static_head_m": max(static_head_m, 0.0), "layout": layout}}
    expected = duty_flows_m3h(plant_parameters(Station.model_validate(fixed)), speed_ratio, 0.0)
    np.testing.assert_allclose(flow_m3h, expected, rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize("layout", ["individual", "common"])
def test_the_kernel_lifts_to_the_delivery_level_from_the_water(layout):
    base = {
        "name": "s",
        "sump": {"area_m2": HUGE_M2},
        "pump": [{"curve": [40.0, -0.02, -1e-4]}] * 2,
        "control": {"mode": "external"},
    }
    lifted = base | {"rising_main": {"delivery_level_m": 16.0, "layout": layout}}
    fixed = base | {"rising_main": {"static_head_m": 16.0 - LEVEL_M, "layout": layout}}
    frequency_hz = np.full((2, 60), 50.0)
    found, expected = (run(Station.model_validate(table), frequency_hz) for table in (lifted, fixed))
    assert expected[0].min() > 50.0
    np.testing.assert_allclose(found, expected, rtol=1e-8)


@given(
    numbers(-20.0, 20.0),
    numbers(0.0, 1e4),
    st.lists(st.tuples(numbers(0.01, 5.0), numbers(0.1, 1e4)), min_size=1, max_size=6),
    numbers(0.0, 1.5),
)
def test_level_and_volume_invert_each_other_on_points_of_volume(level_m, volume_m3, steps, share):
    """At the points too, which are met, and beside them; the floor holds nothing."""
    points = [(level_m, volume_m3)]
    for height_m, rise_m3 in steps:
        points.append((points[-1][0] + height_m, points[-1][1] + rise_m3))
    sump = Sump(volume_points=tuple(points))
    profile = profile_of_slices(sump.slices)
    top_m3 = points[-1][1]
    for point_m, point_m3 in points:
        assert volume_at_level_m3(point_m, profile) == pytest.approx(point_m3, rel=1e-6, abs=1e-6 * top_m3)
    assert level_at_volume_m(0.0, profile) == sump.floor_level_m
    held_m3 = share * top_m3
    at_m = level_at_volume_m(held_m3, profile)
    assert volume_at_level_m3(at_m, profile) == pytest.approx(held_m3, rel=1e-6, abs=1e-6 * top_m3)


@given(numbers(0.2, 3.0), numbers(0.2, 3.0), numbers(0.3, 4.0), numbers(0.01, 4.5))
def test_the_shape_of_a_sump_scales_points_of_volume_by_the_height_over_the_floor(bottom, top, height_m, over_m):
    """Against the slope of the volume, and the factor of straight walls, which is written here a second time."""
    points = [[-3.0, 0.0], [-2.0, 9.0], [1.0, 69.0]]
    effect = {"name": "sump_area_profile", "bottom_factor": bottom, "top_factor": top, "height_m": height_m}
    table = {"name": "s", "sump": {"volume_points": points}, "pump": [{"curve": [36.0, -0.02, -1e-4]}]}
    profile = effective_parameters(Station.model_validate(table | {"effect": [effect]})).profile
    step_m = 1e-5
    around = (over_m - step_m, over_m + step_m)
    edges_m = (1.0, height_m, 2.0 * height_m)
    assume(not any(around[0] <= edge_m <= around[1] for edge_m in edges_m))
    below_m3, above_m3 = (volume_at_level_m3(-3.0 + each_m, profile) for each_m in around)
    factor = np.interp(over_m, [0.0, height_m, 2.0 * height_m], [bottom, 1.0, top])
    configured_m2 = 9.0 if over_m < 1.0 else 20.0
    assert (above_m3 - below_m3) / (2.0 * step_m) == pytest.approx(configured_m2 * factor, rel=1e-5)


def test_a_tunnel_under_zero_keeps_its_water():
    """The volume by the true levels moves by what flows, to 1e-9 m³ in each second, down to the dry floor."""
    table = find_station("twin").model_dump(exclude_none=True)
    table["control"] |= {"start_levels_m": [-1.0], "stop_levels_m": [-2.55]}
    station = Station.model_validate(table)
    scenario = Scenario(name="dry", initial_level_m=-1.5, inflow=RecordedInflow(time_s=[0.0], flow_m3h=[60.0]))
    recording = Simulation(station, scenario, 1).advance(4 * 3600)
    truth = recording.truth
    pumped_m3h = np.sum([truth[f"truth_pump{number}_flow_m3h"] for number in range(1, 5)], axis=0)
    assert pumped_m3h.max() > 100.0
    profile = plant_parameters(station).profile
    volume_m3 = np.array([volume_at_level_m3(level_m, profile) for level_m in truth["truth_level_m"]])
    np.testing.assert_allclose(np.diff(volume_m3), (60.0 - pumped_m3h)[:-1] / 3600.0, rtol=0, atol=1e-9)
    assert truth["truth_level_m"].min() == pytest.approx(-2.55, abs=0.05)
    late = Scenario(name="under", initial_level_m=-2.6)
    with pytest.raises(ValueError, match="the floor of station 'twin' is at -2"):
        Simulation(station, late, 1)
