"""Where the search for an effect begins."""

import pytest

from wetwell.sim2real.attribution.candidates import candidates_of, usual_at
from wetwell.simulator.parameters import plant_parameters


def test_a_strength_that_is_neutral_by_the_guess_has_no_grid():
    (sump,) = candidates_of(1, 1, only=["sump_area_profile"])
    names = [free.name for free in sump.free]
    top = names.index("top_factor")
    moved = [grid[-1][top] != grid[0][top] for grid in sump.start_grids({})]
    assert any(moved)
    fixed = sump.start_grids({"top_factor": 1.0})
    assert len({float(point[top]) for grid in fixed for point in grid}) == 1
    assert len(fixed) > 1, "the other strength still has its grids"


def test_the_mains_of_a_station_are_tried_together_and_one_by_one():
    fixed = [candidate.fixed for candidate in candidates_of(4, 2, only=["friction_bias"])]
    assert fixed == [(("main", 0),), (("main", 1),), (("main", 2),)]
    assert [candidate.fixed for candidate in candidates_of(4, 1, only=["friction_bias"])] == [()]


@pytest.mark.parametrize(
    ("name", "unit", "usual", "reach"),
    [
        ("flow_low_cutoff", "m³/h", 90.0, 200.0),
        ("flow_low_cutoff", "m³/h", 900.0, 900.0),
        ("flow_low_cutoff", "m³/h", 9e4, 5000.0),
        ("flow_low_cutoff", "s²/m²", 900.0, 200.0),
        ("water_inertia", "s²/m²", 2500.0, 75_000.0),
    ],
)
def test_a_parameter_is_looked_for_as_far_as_the_station_is_large(name, unit, usual, reach):
    for given, high in ((None, min(reach, 200.0 if name == "flow_low_cutoff" else 3e4)), ({unit: usual}, reach)):
        found = candidates_of(1, 1, usual=given, only=[name])[0]
        assert (found.free[0].low, found.free[0].high) == (0.0, high)


def test_what_is_usual_at_a_station_goes_by_its_pumps(alpha):
    """A column of water of that inertia is at the rated flow in a second, if all of the rated head pulls."""
    plant = plant_parameters(alpha)
    usual, pump = usual_at(plant), plant.pumps[0]
    flow_m3h = pump.rated_flow_m3h
    head_m = pump.c0 + pump.c1 * flow_m3h + pump.c2 * flow_m3h**2
    assert usual["m³/h"] == flow_m3h
    assert usual["s²/m²"] * flow_m3h / 3600.0 == pytest.approx(head_m)


def test_in_the_grid_of_a_strength_the_others_are_neutral():
    """A guess of fast swings that is wrong would hide how well a daily one does, however strong."""
    (supply,) = candidates_of(1, 1, only=["supply_voltage_variation"])
    daily, fast = ([free.name for free in supply.free].index(name) for name in ("daily_amplitude", "fast_amplitude"))
    (guess,), *grids = supply.start_grids({"fast_amplitude": 0.002, "fast_period_s": 400.0})
    assert guess[fast] > 0.0
    assert all(point[fast] == 0.0 for grid in grids for point in grid if point[daily] > 0.0)
    assert any(point[daily] > 0.0 for grid in grids for point in grid)


def test_a_pattern_is_tried_as_strong_as_the_values_show_it():
    """Beside a range of a thousand metres the deadband of a level is nothing: a grid of strengths never meets it."""
    (rounded,) = candidates_of(1, 1, only=["level_quantisation"])
    held = candidates_of(1, 1, only=["report_by_exception"])[0]
    for one, name, value in ((rounded, "quantum_m", 0.02), (held, "deadband", 0.042)):
        assert one.is_pattern
        ((start,),) = one.start_grids({name: value})
        assert one.free[0].value(float(start[0])) == pytest.approx(value, rel=1e-9)
        assert len(one.start_grids({}, strengths=(0.3, 1.0))) == 1, "without a guess it is probed"
