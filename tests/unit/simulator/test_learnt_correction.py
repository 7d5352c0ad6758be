"""A learnt correction: effects that have a name, its covariates against a second account of them, refusals."""

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.simulator.corrections.parts import COVARIATES, TERMS, Column
from wetwell.simulator.effects import effective_parameters, effects_of
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.power import loaded_power_kw, shaft_power_kw
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

RISING_AND_IDLE = RecordedInflow(time_s=[0.0, 1200.0, 2400.0, 4800.0], flow_m3h=[300.0, 60.0, 180.0, 240.0])
"""Two pumps at once, then single runs with idling between."""
START_NS = 1_736_150_000_000_000_000
SECONDS = 7200


def under(station, *tables):
    return station.model_copy(update={"effect": tuple(EffectTable(**table) for table in tables)})


def learnt(term, *parts, **more):
    return {"name": "learnt_correction", "term": term, "part": parts, **more}


def part(covariate, shape="linear", size=0.1, low=-1e6, high=1e6, **more):
    return {"covariate": covariate, "shape": shape, "size": size, "low": low, "high": high, **more}


def run(station, seconds=SECONDS):
    scenario = Scenario(name="hours", initial_level_m=1.5, inflow=RISING_AND_IDLE)
    recording = Simulation(station, scenario, seed=3, start_ns=START_NS).advance(seconds)
    return {**recording.columns, **recording.truth}


@pytest.mark.parametrize(
    ("correction", "place"),
    [
        (learnt("power", offset=0.1), "power_meter"),
        (learnt("power", offset=0.1, pump=2), "drive"),
        (learnt("power", part("flow_m3h")), "drive"),
        (learnt("speed", offset=-0.05), "drive"),
        (learnt("speed", part("hour_of_day")), "drive"),
        (learnt("speed", offset=-0.05, pump=2), "pump"),
        (learnt("speed", part("since_start_s")), "pump"),
        (learnt("pump_head", offset=-0.05), "pump"),
        (learnt("inertia", offset=0.1), "rising_main"),
        (learnt("back_flow", offset=0.1), "pump"),
        (learnt("sump_area", part("level_m")), "sump"),
    ],
)
def test_the_cause_lies_where_its_term_is_or_where_what_it_goes_with_points(alpha, correction, place):
    (effect,) = effects_of(under(alpha, correction))
    assert effect.place == place


@pytest.mark.parametrize("layout", ["individual", "common"])
@pytest.mark.parametrize(
    ("term", "offset", "named"),
    [
        ("head_loss", 0.3, {"name": "friction_bias", "factor": 1.3}),
        ("static_head", 0.1, {"name": "static_head_bias", "offset_m": 0.1}),
        ("inertia", 0.2, {"name": "water_inertia", "inertia_s2_m2": 0.2}),
        ("pump_head", -0.15, {"name": "pump_wear", "head_loss": 0.15}),
        ("flow_reading", 0.12, {"name": "flow_meter_gain", "factor": 1.12}),
        ("head_reading", 0.1, {"name": "head_sensor_offset", "offset_m": 0.1}),
        ("level_balance", 0.08, {"name": "unmetered_inflow", "flow_m3h": 0.08}),
        ("back_flow", 0.05, {"name": "check_valve_leak", "leak_m3h": 0.05}),
        ("sump_area", 0.2, {"name": "sump_area_profile", "height_m": 0.1, "bottom_factor": 1.2, "top_factor": 1.2}),
    ],
)
def test_a_constant_correction_is_the_effect_that_has_a_name(term, offset, named, layout, quiet_alpha):
    main = quiet_alpha.rising_main.model_copy(update={"layout": layout})
    plain = quiet_alpha.model_copy(update={"rising_main": main})
    station = under(plain, learnt(term, offset=offset))
    (effect,) = effects_of(station)
    reference = effect.reference(plant_parameters(station))
    named = {
        key: value * reference if key in {"offset_m", "inertia_s2_m2", "flow_m3h", "leak_m3h"} else value
        for key, value in named.items()
    }
    ours, theirs = run(station), run(under(plain, named))
    compared = [name for name in ours if not name.startswith("truth_")]
    for name in compared:
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_slower_pump_takes_less_power_where_power_goes_with_the_load(quiet_alpha):
    station = under(quiet_alpha, {"name": "load_dependent_power", "share": 1.0}, learnt("speed", offset=-0.04))
    plant, rows = effective_parameters(station), run(station)
    pump, ratio = plant.pumps[0], rows["pump1_frequency_hz"] / plant.pumps[0].nominal_frequency_hz
    flow_m3h = rows["truth_pump1_flow_m3h"]
    steady = np.flatnonzero(np.convolve(ratio > 0.0, np.ones(61), "valid") == 61)[:50] + 60
    assert steady.size == 50
    for at in steady:
        shaft_kw = shaft_power_kw(
            0.96 * ratio[at], flow_m3h[at], pump.rated_flow_m3h, pump.rated_shaft_kw, pump.shutoff_power_share
        )
        power_kw = loaded_power_kw(shaft_kw, pump.rated_shaft_kw, plant.motor_efficiency, plant.drive_efficiency)
        assert rows["truth_pump1_power_kw"][at] == pytest.approx(power_kw, rel=1e-6)


def covariates_of(rows, pump):
    """The covariates of the flow reading of a pump, by another way: from the columns of a recording."""
    running = np.array([rows[f"pump{i}_frequency_hz"] > 0.0 for i in (1, 2, 3)])
    mine, place = running[pump - 1], np.arange(running.shape[1])
    stood = np.maximum.accumulate(np.where(mine, -1, place))
    clock_s = START_NS / 1e9 + place
    return {
        "level_m": rows["truth_level_m"],
        "flow_m3h": np.r_[0.0, rows[f"truth_pump{pump}_flow_m3h"][:-1]],
        "speed_ratio": rows[f"pump{pump}_frequency_hz"] / 50.0,
        "since_start_s": (place - stood).astype(float),
        "hour_of_day": clock_s % 86_400 / 3600.0,
        "day_of_week": (clock_s / 86_400 - 4) % 7.0,
        "days": clock_s / 86_400,
        "pumps_on_main": running.sum(axis=0).astype(float),
    }


SHAPES = {
    "linear": lambda z: z,
    "square": lambda z: z**2,
    "cosine": lambda z: np.cos(2.0 * np.pi * z),
    "decay": lambda z: np.exp(-z),
    "logarithm": lambda z: np.log1p(np.maximum(z, 0.0)),
    "step": lambda z: (z >= 0.0) * 1.0,
}
KNOWN = {
    "level_m": (0.4, 1.6),
    "flow_m3h": (10.0, 190.0),
    "speed_ratio": (0.2, 0.9),
    "since_start_s": (0.0, 300.0),
    "hour_of_day": (7.0, 9.0),
    "day_of_week": (0.33, 0.4),
    "days": (20_094.33, 20_094.4),
    "pumps_on_main": (1.0, 3.0),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("covariate", KNOWN)
def test_reading_goes_with_the_covariate_as_the_shape_says(covariate, shape, quiet_alpha):
    low, high = KNOWN[covariate]
    centre, scale = (low if shape in {"decay", "logarithm"} else 0.5 * (low + high)), high - low
    table = part(covariate, shape, 0.1, low, high, centre=centre, scale=scale)
    rows = run(under(quiet_alpha, learnt("flow_reading", table, pump=2)))
    known = covariates_of(rows, 2)[covariate]
    known = known if shape == "cosine" else np.clip(known, low, high)
    true = rows["truth_pump2_flow_m3h"]
    at = true > 1.0
    assert at.sum() > 300
    expected = 1.0 + 0.1 * SHAPES[shape]((known - centre) / scale)
    np.testing.assert_allclose((rows["pump2_flow_m3h"] / np.where(at, true, 1.0))[at], expected[at], rtol=1e-6)
    assert np.ptp(expected[at]) > 1e-3
    for other in (1, 3):
        np.testing.assert_array_equal(rows[f"pump{other}_flow_m3h"], rows[f"truth_pump{other}_flow_m3h"])


def test_idle_time_is_that_of_the_pipe(quiet_alpha):
    main = quiet_alpha.rising_main.model_copy(update={"layout": "common"})
    station = quiet_alpha.model_copy(update={"rising_main": main})
    table = part("idle_before_s", "linear", 0.1, 0.0, 4000.0, scale=1000.0)
    rows = run(under(station, learnt("flow_reading", table)))
    running = np.array([rows[f"pump{i}_frequency_hz"] > 0.0 for i in (1, 2, 3)])
    any_running, place = running.any(axis=0), np.arange(SECONDS)
    checked = 0
    for pump, mine in enumerate(running, start=1):
        for start in np.flatnonzero(mine[1:] & ~mine[:-1]) + 1:
            if any_running[start - 1] or not any_running[:start].any():
                continue
            idle_s = start - 1 - place[:start][any_running[:start]][-1]
            true = rows[f"truth_pump{pump}_flow_m3h"][start + 30]
            assert rows[f"pump{pump}_flow_m3h"][start + 30] / true == pytest.approx(1.0 + 1e-4 * idle_s, rel=1e-6)
            checked += 1
    assert checked >= 2


def test_each_term_moves_its_own_signal(quiet_alpha):
    plain = run(quiet_alpha)
    own = {"flow_reading": "flow_m3h", "head_reading": "head_m", "power": "power_kw"}
    for term, name in own.items():
        rows = run(under(quiet_alpha, learnt(term, part("since_start_s", "decay", 0.2, 0.0, 600.0, scale=60.0))))
        moved = {column for column in plain if not np.array_equal(plain[column], rows[column])}
        shown = {column for column in moved if not column.startswith("truth_")}
        assert shown == {f"pump{i}_{name}" for i in (1, 2, 3)}, term
    for term in set(TERMS) - set(own):
        rows = run(under(quiet_alpha, learnt(term, part("since_start_s", "decay", 0.1, 0.0, 600.0, scale=60.0))))
        assert not np.array_equal(rows["level_m"], plain["level_m"]), term


def test_less_than_nothing_flows_back_through_no_pump(quiet_alpha):
    plain, rows = run(quiet_alpha), run(under(quiet_alpha, learnt("back_flow", offset=-0.05)))
    np.testing.assert_allclose(rows["level_m"], plain["level_m"], rtol=1e-12)


def test_where_the_area_is_twice_as_large_the_level_moves_half_as_fast(quiet_alpha):
    above = part("level_m", "step", 1.0, 0.0, 9.0, centre=1.0, scale=1.0)
    rows = run(under(quiet_alpha, learnt("sump_area", above)))
    level_m = rows["truth_level_m"]
    net_m3h = rows["inflow_m3h"] - sum(rows[f"truth_pump{i}_flow_m3h"] for i in (1, 2, 3))
    moved = (net_m3h[:-1] != 0.0) & (level_m[:-1] < 3.0) & (level_m[:-1] > 0.1)
    area_m2 = (net_m3h[:-1] / 3600.0)[moved] / np.diff(level_m)[moved]
    is_above = level_m[:-1][moved] >= 1.0
    assert min(is_above.sum(), (~is_above).sum()) > 300
    assert np.median(area_m2[is_above]) == pytest.approx(2.0 * np.median(area_m2[~is_above]), rel=1e-3)


def test_a_column_without_values_stands_at_its_centre(quiet_alpha):
    table = part("column", "linear", 0.1, 0.0, 20.0, column="rain_mm_h", centre=5.0, scale=5.0)
    assert effective_parameters(under(quiet_alpha, learnt("head_loss", table))).columns == (Column(name="rain_mm_h"),)
    np.testing.assert_array_equal(
        run(under(quiet_alpha, learnt("head_loss", table)))["level_m"], run(quiet_alpha)["level_m"]
    )


def test_an_expression_is_data_and_nothing_else(quiet_alpha):
    assert len(COVARIATES) == 10
    for covariate in ("__import__('os')", "level", "level_m**2"):
        with pytest.raises(ValueError, match="covariate: got") as caught:
            effects_of(under(quiet_alpha, learnt("head_loss", part(covariate))))
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "rule"),
    [
        (learnt("friction"), "effect[1].learnt_correction.term: got 'friction'"),
        (learnt("head_loss", part("level_m", "tangent")), "part[1].shape: got 'tangent'"),
        (learnt("head_loss", part("level_m", size=float("nan"))), "part[1].size: got nan"),
        (learnt("head_loss", part("level_m", size=40.0)), "part[1].size: got 40.0"),
        (learnt("head_loss", part("level_m", scale=0.0)), "part[1].scale: got 0.0"),
        (learnt("head_loss", part("level_m", formula="x")), "part[1].formula: unknown key"),
        (learnt("head_loss", part("column")), "part[1]: column: is for covariate 'column', and needed there"),
        (learnt("head_loss", part("level_m", column="rain")), "part[1]: column: is for covariate 'column'"),
        (learnt("head_loss", part("level_m", noise=0.1)), "part[1]: noise: got 0.1, only a column has errors"),
        (learnt("head_loss", part("column", column="rain", noise=-1.0)), "part[1].noise"),
        (learnt("head_loss", part("column", column="../x")), "part[1].column: got '../x'"),
        (learnt("head_loss", part("level_m", low=2.0, high=1.0)), "part[1]: high: got 1, must lie over low = 2"),
        (
            learnt("head_loss", {"covariate": "level_m", "shape": "linear", "size": 0.1}),
            "part[1]: low, high: missing; shape 'linear' needs the range",
        ),
        (
            learnt("head_loss") | {"part": part("level_m")},
            "effect[1].learnt_correction.part: is one table, must be a list of tables: write [[effect.part]]",
        ),
        (learnt("head_loss", *[part("level_m")] * 4), "effect[1].learnt_correction.part: got"),
        (
            learnt("pump_head", part("level_m", size=-1.0, low=0.0, high=1.0)),
            "effect[1]: learnt_correction: pump_head would fall to 0 of itself, must keep 0.05",
        ),
        (
            learnt("static_head", part("level_m", size=2.0, low=0.0, high=1.0)),
            "learnt_correction: static_head would rise to 54 m, pump 1 lifts 36 m: no water would flow",
        ),
        (learnt("head_loss", pump=2), "learnt_correction.pump: got 2, term 'head_loss' has no pump of its own"),
        (learnt("speed", main=1), "learnt_correction.main: got 1, term 'speed' has no main of its own"),
        (learnt("speed", pump=9), "effect[1].pump: got 9, there are 3 pumps"),
    ],
)
def test_bad_corrections_are_refused_in_one_line(table, rule, alpha):
    with pytest.raises(ValueError, match="effect") as caught:
        effective_parameters(under(alpha, table))
    assert "\n" not in str(caught.value)
    assert rule in str(caught.value)
