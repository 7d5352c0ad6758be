"""What holds for every station, inflow and seed."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from wetwell.protocols.station.control import Control
from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.protocols.station.sump import Sump
from wetwell.simulator.control.drive import slipped
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.hydraulics import common_flows, flow_at_head_m3h, pump_head_m
from wetwell.simulator.inflow.empirical import EmpiricalInflow
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.inflow.surges import Surges
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation
from wetwell.simulator.wet_well import next_volume_m3, profile_of, volume_at_level_m3

SECONDS = 600
SEEDS = st.integers(0, 2**32)


def numbers(least, most):
    return st.floats(least, most, allow_nan=False)


@st.composite
def curves(draw, least_shutoff_m=10.0):
    """Falling curve from its shut-off head, its run-out flow and the share of the straight part."""
    shutoff_m, run_out_m3h, straight = draw(numbers(least_shutoff_m, 60)), draw(numbers(50, 400)), draw(numbers(0, 1))
    return shutoff_m, -straight * shutoff_m / run_out_m3h, -(1 - straight) * shutoff_m / run_out_m3h**2


@st.composite
def stations(draw, layout=None):
    pumps = draw(st.lists(curves(), min_size=1, max_size=4))
    levels = draw(st.integers(1, len(pumps)))
    stop_m = np.cumsum([draw(numbers(-0.2, 1)) if n == 0 else draw(numbers(0, 0.5)) for n in range(levels)])
    start_m = np.maximum.accumulate(stop_m + [draw(numbers(0.05, 2)) for _ in range(levels)])
    noise = draw(numbers(0, 0.02))
    return Station.model_validate(
        {
            "name": "drawn",
            "sump": {"area_m2": draw(numbers(1, 40))},
            "pump": [{"curve": curve, "nominal_frequency_hz": draw(st.sampled_from([50, 60]))} for curve in pumps],
            "rising_main": {
                "static_head_m": draw(numbers(0, 9)),
                "friction_h2_m5": draw(numbers(0, 2e-3)),
                "layout": layout or draw(st.sampled_from(["individual", "common"])),
            },
            "control": {
                "start_levels_m": start_m.tolist(),
                "stop_levels_m": stop_m.tolist(),
                "ramp_s": draw(numbers(0.5, 30)),
                "min_frequency_hz": draw(numbers(0, 30)),
                "dwell_s": draw(numbers(0, 10)),
            },
            "sensors": {
                "flow_noise": noise,
                "head_noise": noise,
                "power_noise": noise,
                "inflow_noise": noise,
                "level_noise_m": noise,
            },
        }
    )


@st.composite
def scenarios(draw, faults=True):
    flows = draw(st.lists(numbers(0, 800), min_size=1, max_size=6))
    recorded = RecordedInflow(time_s=[90.0 * n for n in range(len(flows))], flow_m3h=flows)
    surges = Surges(rate_per_s=0.01, flow_m3h=draw(numbers(0, 200)), duration_s=draw(st.integers(1, 120)))
    fault = (
        Blockage(pump=1, start_s=50, end_s=draw(numbers(51, 500)), speed_loss=draw(numbers(0, 0.9)), after="clear"),
        PipeClogging(start_s=100, end_s=400, friction_rise=draw(numbers(0, 3)), static_rise_m=draw(numbers(0, 3))),
    )
    return Scenario(
        name="drawn",
        initial_level_m=draw(numbers(0, 3)),
        inflow=draw(st.sampled_from([recorded, EmpiricalInflow(surges=surges)])),
        fault=fault if faults else (),
    )


def per_pump(recording, quantity):
    columns = recording.truth if quantity.startswith("truth") else recording.columns
    before, after = ("truth_", quantity.removeprefix("truth_")) if quantity.startswith("truth") else ("", quantity)
    return np.array([columns[f"{before}pump{i}_{after}"] for i in range(1, recording.pumps + 1)])


def balance_error_m(station, recording):
    """Largest difference between the change of the level and what came in and went out, in metres."""
    level_m = recording.truth["truth_level_m"]
    net_m3h = recording.truth["truth_inflow_m3h"] - per_pump(recording, "truth_flow_m3h").sum(axis=0)
    return np.abs(np.diff(level_m) - net_m3h[:-1] / 3600.0 / station.sump.area_m2).max()


def same_columns(left, right):
    return list(left.columns) == list(right.columns) and all(
        left.columns[name].tobytes() == right.columns[name].tobytes() for name in left.columns
    )


@settings(max_examples=60)
@given(stations(), scenarios(), SEEDS)
def test_mass_balance_closes_and_no_flow_is_negative(station, scenario, seed):
    recording = Simulation(station, scenario, seed).advance(SECONDS)
    assert balance_error_m(station, recording) < 1e-9
    assert per_pump(recording, "truth_flow_m3h").min() >= 0
    assert recording.truth["truth_level_m"].min() >= 0
    standing = per_pump(recording, "frequency_hz") == 0
    for quantity in ("flow_m3h", "head_m", "power_kw", "running", "truth_flow_m3h"):
        assert not per_pump(recording, quantity)[standing].any()
    assert all(np.isfinite(column).all() for column in recording.columns.values())


@st.composite
def shaped_stations(draw):
    """Stations with a profile, a weir, check valves that leak, and one that holds its level by speed."""
    station = draw(stations(layout="individual"))
    heights_m = draw(st.lists(numbers(0.1, 1.5), min_size=1, max_size=4))
    areas_m2 = draw(st.lists(numbers(1, 40), min_size=len(heights_m) + 1, max_size=len(heights_m) + 1))
    profile = tuple(zip(np.cumsum([0.0, *heights_m]).tolist(), areas_m2, strict=True))
    sump = Sump(
        area_m2=1.0, profile=profile, overflow_level_m=draw(numbers(0.2, 4)), weir_width_m=draw(numbers(0.1, 5))
    )
    control = station.control.model_copy(
        update={
            "mode": draw(st.sampled_from(["on_off", "pid"])),
            "setpoint_m": draw(numbers(0.1, 2)),
            "gain_hz_m": draw(numbers(1, 100)),
            "integral_s": draw(numbers(1, 1000)),
            "derivative_s": draw(numbers(0, 20)),
            "rotation": draw(st.sampled_from(["round_robin", "fixed", "least_run_time"])),
            "max_starts_per_hour": draw(st.integers(0, 6)),
        }
    )
    leak = EffectTable(name="check_valve_leak", leak_m3h=draw(numbers(0, 20)))
    return station.model_copy(update={"sump": sump, "control": control, "effect": (leak,)})


@settings(max_examples=60)
@given(shaped_stations(), scenarios(), SEEDS)
def test_mass_balance_closes_with_profile_weir_leak_and_level_controller(station, scenario, seed):
    """To 1e-9 m³ in each second; the back flow K sqrt(H) of standing pumps is written here a second time."""
    recording = Simulation(station, scenario, seed).advance(SECONDS)
    truth, frequency_hz = recording.truth, per_pump(recording, "frequency_hz")
    static_head_m = station.rising_main.static_head_m + truth["truth_static_rise_m"]
    nominal_hz = np.array([[pump.nominal_frequency_hz] for pump in station.pump])
    is_standing = frequency_hz / nominal_hz == 0  # 5e-324 Hz is no speed
    back_m3h = is_standing.sum(axis=0) * station.effect[0].leak_m3h * np.sqrt(static_head_m)
    pumped_m3h = per_pump(recording, "truth_flow_m3h").sum(axis=0)
    net_m3h = truth["truth_inflow_m3h"] + back_m3h - truth["truth_overflow_m3h"] - pumped_m3h
    profile = profile_of(station.sump.profile)
    volume_m3 = np.array([volume_at_level_m3(level_m, profile) for level_m in truth["truth_level_m"]])
    np.testing.assert_allclose(np.diff(volume_m3), net_m3h[:-1] / 3600.0, rtol=0, atol=1e-9)
    assert pumped_m3h.min() >= 0
    assert truth["truth_overflow_m3h"].min() >= 0
    assert frequency_hz[frequency_hz > 0].min(initial=np.inf) >= station.control.min_frequency_hz


@given(numbers(0, 5), numbers(-500, 500), numbers(0, 200), st.lists(numbers(0, 300), min_size=1, max_size=4))
def test_nothing_takes_more_than_the_wet_well_holds(volume_m3, inflow_m3h, overflow_m3h, flows_m3h):
    """Not an inflow under 0, either, which an observer of the level may suppose while no pump runs."""
    taken_m3h = np.array(flows_m3h)
    after_m3 = next_volume_m3(volume_m3, inflow_m3h, overflow_m3h, taken_m3h)
    assert 0.0 <= after_m3 < np.inf
    assert np.all((taken_m3h >= 0.0) & (taken_m3h <= flows_m3h))
    balance_m3 = volume_m3 + (inflow_m3h - overflow_m3h - taken_m3h.sum()) / 3600.0
    assert after_m3 == pytest.approx(max(balance_m3, 0.0), abs=1e-9)


@pytest.mark.parametrize("layout", ["individual", "common"])
@pytest.mark.parametrize("inflow_m3h", [0.0, 40.0])
def test_mass_balance_closes_when_the_wet_well_runs_dry(quiet_alpha, layout, inflow_m3h):
    """Stop levels under the floor: the pumps never stop, and take only what comes in."""
    station = quiet_alpha.model_copy(
        update={
            "control": Control(start_levels_m=(0.2, 0.3, 0.4), stop_levels_m=(-1.0, -1.0, -1.0)),
            "rising_main": quiet_alpha.rising_main.model_copy(update={"layout": layout}),
        }
    )
    inflow = RecordedInflow(time_s=[0.0], flow_m3h=[inflow_m3h])
    scenario = Scenario(name="dry", initial_level_m=0.5, inflow=inflow)
    recording = Simulation(station, scenario, 1).advance(SECONDS)
    level_m, total_m3h = recording.truth["truth_level_m"], per_pump(recording, "truth_flow_m3h").sum(axis=0)
    assert (per_pump(recording, "frequency_hz")[:, -1] == 50).all()
    assert (level_m[-100:] == 0).all()
    assert total_m3h[-100:] == pytest.approx(inflow_m3h, abs=1e-9)
    assert per_pump(recording, "truth_flow_m3h").min() >= 0
    assert balance_error_m(station, recording) < 1e-9


@given(curves(), numbers(0.05, 1.2), numbers(0, 300), numbers(0.1, 300))
def test_head_falls_with_flow(curve, speed_ratio, flow_m3h, more_m3h):
    head_m = pump_head_m(*curve, speed_ratio, flow_m3h)
    assert pump_head_m(*curve, speed_ratio, flow_m3h + more_m3h) < head_m


@given(curves(), numbers(0.05, 1.2), numbers(0, 300))
def test_affinity_laws(curve, speed_ratio, flow_m3h):
    nominal_head_m = pump_head_m(*curve, 1.0, flow_m3h)
    head_m = pump_head_m(*curve, speed_ratio, speed_ratio * flow_m3h)
    assert head_m == pytest.approx(speed_ratio**2 * nominal_head_m, rel=1e-9, abs=1e-9)
    scaled_m3h = flow_at_head_m3h(*curve, speed_ratio, speed_ratio**2 * 5.0)
    assert scaled_m3h == pytest.approx(speed_ratio * flow_at_head_m3h(*curve, 1.0, 5.0), rel=1e-9)


@given(curves(), numbers(0.3, 1.2), numbers(1e-3, 0.999))
def test_flow_at_head_inverts_the_curve(curve, speed_ratio, share):
    head_m = share * curve[0] * speed_ratio**2
    flow_m3h = flow_at_head_m3h(*curve, speed_ratio, head_m)
    assert flow_m3h > 0
    assert pump_head_m(*curve, speed_ratio, flow_m3h) == pytest.approx(head_m, rel=1e-9)


@settings(max_examples=300)
@given(
    st.lists(st.tuples(curves(1.0), numbers(0, 1.2)), min_size=1, max_size=6),
    numbers(0, 20),
    st.one_of(st.just(0.0), numbers(1e-9, 1.0)),
)
@example([((30.0, 0.0, -1e-3), 1.0), ((15.0, 0.0, -1e-3), 1.0)], 2.0, 6e-4)
@example([((1.0, -0.0, -4e-4), 1.0), ((1.0, -0.0, -2.5e-5), 1.56e-160)], 0.0, 1.0)
def test_header_balances_and_shares_one_head(pumps, static_head_m, friction_h2_m5):
    """Each pump meets the header's head, or is behind a closed check valve because it cannot reach it."""
    flow_m3h = np.zeros(len(pumps))
    speed_ratio = np.array([ratio for _, ratio in pumps])
    curves = np.array([curve for curve, _ in pumps])
    common_flows(
        np.arange(len(pumps)), curves, speed_ratio, static_head_m, 0.0, friction_h2_m5, 0.0, 0.0, 0.0, 0.0, flow_m3h
    )
    assert (flow_m3h >= 0).all()
    header_m = static_head_m + friction_h2_m5 * flow_m3h.sum() ** 2
    for (curve, ratio), flow in zip(pumps, flow_m3h, strict=True):
        if flow > 0:
            assert pump_head_m(*curve, ratio, flow) == pytest.approx(header_m, abs=1e-5)
        else:
            assert curve[0] * ratio**2 <= header_m + 1e-5


@settings(max_examples=15)
@given(stations(), scenarios(), SEEDS)
def test_same_seed_same_bytes_other_seed_other_noise(station, scenario, seed):
    once, again = (Simulation(station, scenario, seed).advance(SECONDS) for _ in range(2))
    assert same_columns(once, again)
    assert once.time_ns.tobytes() == again.time_ns.tobytes()
    if station.sensors.level_noise_m > 1e-6:
        assert not same_columns(once, Simulation(station, scenario, seed + 1).advance(SECONDS))


@settings(max_examples=25)
@given(stations(), scenarios(), SEEDS, st.lists(st.integers(0, 200), max_size=8))
@example(
    Station(name="one", sump={"area_m2": 2}, pump=[{"curve": (30, 0, -1e-3)}]),
    Scenario(name="one", inflow=EmpiricalInflow(surges=Surges(duration_s=20, rate_per_s=0.1))),
    1,
    [1] * 100,
)
def test_blocks_of_any_lengths_give_the_same_numbers(station, scenario, seed, lengths):
    whole = Simulation(station, scenario, seed).advance(SECONDS)
    simulation = Simulation(station, scenario, seed)
    lengths = [length for n, length in enumerate(lengths) if sum(lengths[: n + 1]) <= SECONDS]
    blocks = [simulation.advance(length) for length in [*lengths, SECONDS - sum(lengths)]]
    assert simulation.seconds == SECONDS
    assert np.concatenate([block.time_ns for block in blocks]).tobytes() == whole.time_ns.tobytes()
    for kind in ("columns", "truth"):
        for name, column in getattr(whole, kind).items():
            joined = np.concatenate([getattr(block, kind)[name] for block in blocks])
            if column.dtype == np.object_:
                assert joined.tolist() == column.tolist()
            else:
                assert joined.tobytes() == column.tobytes()


@settings(max_examples=15)
@given(stations(), scenarios(faults=False), SEEDS)
def test_faults_of_zero_strength_change_no_bit(station, scenario, seed):
    nothing = (
        Blockage(pump=1, start_s=0, end_s=100, speed_loss=0),
        PipeClogging(start_s=0, end_s=100, friction_rise=0, static_rise_m=0),
    )
    healthy = Simulation(station, scenario, seed).advance(SECONDS)
    faulty = Simulation(station, scenario.model_copy(update={"fault": nothing}), seed).advance(SECONDS)
    assert same_columns(healthy, faulty)


@settings(max_examples=25)
@given(stations(), scenarios(), SEEDS)
def test_at_most_one_start_or_stop_a_second_and_never_more_pumps_than_levels(station, scenario, seed):
    simulation = Simulation(station, scenario, seed)
    plant = simulation._plant
    before = set(plant.commanded)
    for _ in range(SECONDS // 2):
        level_m = simulation.advance(1).columns["level_m"][0]
        commanded = set(plant.commanded)
        assert len(commanded ^ before) <= 1
        assert len(commanded) <= len(station.control.start_levels_m)
        if commanded > before:
            assert level_m >= station.control.start_levels_m[len(before)]
        elif commanded < before:
            assert level_m <= station.control.stop_levels_m[len(before) - 1]
        before = commanded


@settings(max_examples=20)
@given(stations(), SEEDS, st.integers(0, 3))
def test_a_pump_that_is_switched_off_ramps_down_and_never_starts(station, seed, which):
    """Under a flood every pump is wanted all the time."""
    pump = which % len(station.pump) + 1
    flood = RecordedInflow(time_s=[0.0], flow_m3h=[5000.0])
    simulation = Simulation(station, Scenario(name="flood", inflow=flood, initial_level_m=5.0), seed)
    simulation.advance(120)
    simulation.change_settings({f"pump{pump}_auto": 0})
    assert simulation.settings[f"pump{pump}_auto"] == 0
    frequency_hz = simulation.advance(300).columns[f"pump{pump}_frequency_hz"]
    assert (np.diff(frequency_hz) <= 0).all()
    allowed_s = station.control.ramp_s + station.control.dwell_s + 3
    assert not frequency_hz[int(np.ceil(allowed_s)) :].any()
    simulation.change_settings({f"pump{pump}_auto": 1})
    wanted = len(station.control.start_levels_m) == len(station.pump)
    assert simulation.advance(60).columns[f"pump{pump}_frequency_hz"].any() == wanted


@settings(max_examples=10)
@given(stations(layout="individual"), SEEDS)
def test_changed_levels_act_from_the_next_second_on(station, seed):
    control = Control(start_levels_m=(3.0,), stop_levels_m=(0.5,), ramp_s=10.0)
    sensors = station.sensors.model_copy(update={"level_noise_m": 0.0})
    station = station.model_copy(update={"control": control, "sensors": sensors})
    dry = RecordedInflow(time_s=[0.0], flow_m3h=[0.0])
    simulation = Simulation(station, Scenario(name="still", inflow=dry, initial_level_m=2.0), seed)
    assert not simulation.advance(10).columns["pump1_frequency_hz"].any()
    simulation.change_settings({"start_level1_m": 1.9})
    assert simulation.advance(3).columns["pump1_frequency_hz"] == pytest.approx(
        station.pump[0].nominal_frequency_hz / 10.0 * np.arange(3)
    )
    simulation.change_settings({"start_level1_m": 3.0, "stop_level1_m": 2.5})
    assert np.argmax(simulation.advance(5).columns["pump1_frequency_hz"]) == 0


@given(numbers(0.05, 1), numbers(0, 300), numbers(0, 0.3), numbers(0, 1))
def test_a_motor_that_slips_turns_at_the_speed_at_which_its_torque_leaves_it(commanded, flow_m3h, slip, share):
    rated_m3h = 200.0

    def speed_at(at_m3h, along_m3h):
        at_rest, fall_h_m3 = slipped(commanded, along_m3h, slip, share, rated_m3h)
        return at_rest - fall_h_m3 * at_m3h

    speed = speed_at(flow_m3h, flow_m3h)
    torque = speed * (share * speed + (1.0 - share) * flow_m3h / rated_m3h)
    assert speed == pytest.approx(commanded - slip * torque, abs=1e-12)
    assert speed_at(flow_m3h + 1.0, flow_m3h) == pytest.approx(speed_at(flow_m3h + 1.0, flow_m3h + 1.0), abs=1e-5)
