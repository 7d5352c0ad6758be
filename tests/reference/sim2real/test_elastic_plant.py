"""The elastic plant against closed forms and other solvers, and each deviation where it must show.

Tolerances: duties to the remainder of the last step, 1e-6; volumes to what trapezoids between the seconds miss of a
ramp, 1e-3; a rigid column beside an elastic one, 2 % of the flow (its waves).
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from wetwell.protocols.station.station_file import Sensors
from wetwell.sim2real.truth.case import Deviation, TrueInflow, TruthCase
from wetwell.sim2real.truth.elastic import kernel, machine, plant
from wetwell.sim2real.truth.elastic.deviations import ELASTIC_DEVIATIONS, ELASTIC_LIBRARY, ELASTIC_OPEN
from wetwell.sim2real.truth.elastic.instruments import Instrument, arrived, sensor_noise
from wetwell.sim2real.truth.elastic.machine import load_torque, turned
from wetwell.sim2real.truth.elastic.pipe import TICK_S, advance, friction_factor
from wetwell.sim2real.truth.elastic.plant import machinery_of, passage_of, run_elastic
from wetwell.sim2real.truth.elastic.spec import Machinery, duty, spec_of
from wetwell.sim2real.truth.elastic.stations import case_of
from wetwell.sim2real.truth.elastic.weather import inflow_m3h, wandering
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.effects import LIBRARY as SEARCHED

STEADY = TrueInflow(mean_m3h=90.0, swing=0.0, noise=0.0, rain_per_day=0.0)
QUIET = Sensors(flow_noise=0, head_noise=0, power_noise=0, inflow_noise=0, level_noise_m=0)
HOURS_3 = 10_800


def settled(passage, count):
    """Seconds in which as many pumps have run at full speed for 20 s, all others stand."""
    command = passage.pump_record[kernel.COMMAND]
    now = ((command == 1.0).sum(0) == count) & ((command > 0.0).sum(0) == count)
    return now & np.roll(now, 20)


def test_one_pump_settles_at_its_duty(quiet_alpha):
    passage = passage_of(TruthCase(station=quiet_alpha, inflow=STEADY, seconds=HOURS_3))
    at = settled(passage, 1) & (passage.pump_record[kernel.COMMAND, 0] == 1.0)
    assert at.sum() > 60
    flow, head_m = duty(quiet_alpha, 0)
    np.testing.assert_allclose(passage.pump_record[kernel.FLOW, 0, at], flow, rtol=1e-6)
    np.testing.assert_allclose(passage.pump_record[kernel.HEAD, 0, at], head_m, rtol=1e-6)
    np.testing.assert_allclose(passage.pump_record[kernel.POWER, 0, at], passage.truth.spec.rated_w[0], rtol=1e-6)


@pytest.mark.parametrize("length_m", [2.0, 10.0, 80.0])
@pytest.mark.parametrize("seed", range(6))
def test_a_pump_alone_runs_steadily_whatever_its_main(seed, length_m, monkeypatch):
    monkeypatch.setattr(plant, "machinery_of", lambda _: Machinery(length_m=length_m, wave_m_s=1200.0))
    case = case_of((), "s", np.random.default_rng(seed), seconds=HOURS_3)
    passage = passage_of(case)
    at = settled(passage, 1) & (passage.pump_record[kernel.COMMAND, 0] == 1.0)
    assert at.any()
    np.testing.assert_allclose(passage.pump_record[kernel.FLOW, 0, at], duty(case.station, 0)[0], rtol=2e-3)


@pytest.mark.parametrize("shared", [0.6, 1.0])
def test_two_pumps_on_a_header_settle_where_the_quadratic_says(quiet_alpha, shared):
    deviation = Deviation(name="common_header", parameters={"shared_fraction": shared})
    inflow = replace(STEADY, mean_m3h=210.0, most_m3h=400.0)
    passage = passage_of(TruthCase(station=quiet_alpha, deviations=(deviation,), inflow=inflow, seconds=HOURS_3))
    at = settled(passage, 2)
    assert at.any()
    spec = passage.truth.spec
    flows = passage.pump_record[kernel.FLOW][:, at]
    speed = 1.0 + spec.slip / spec.compensation * 0.1  # less torque than at the duty of one: a little less slip
    c0, c1, c2 = quiet_alpha.pump[0].coefficients
    loss = quiet_alpha.mains[0].friction_h2_m5

    def head_left_m(flow_m3h, ratio):
        made_m = c0 * ratio**2 + c1 * ratio * flow_m3h + c2 * flow_m3h**2
        return made_m - quiet_alpha.mains[0].lift_at_zero_m - loss * (1 - shared + 4 * shared) * flow_m3h**2

    slow, fast = (brentq(head_left_m, 0.0, 500.0, args=(ratio,)) / 3600.0 for ratio in (1.0, speed + 0.01))
    assert slow * 0.98 < flows[flows > 0.0].min() <= flows.max() < fast * 1.02  # friction follows Reynolds by 2 %


def test_volumes_balance(quiet_alpha):
    passage = passage_of(TruthCase(station=quiet_alpha, inflow=STEADY, seconds=HOURS_3))
    level_m, flow = passage.station_record[kernel.LEVEL], passage.pump_record[kernel.FLOW].sum(0)
    pumped_m3 = np.sum(0.5 * (flow[1:] + flow[:-1]))
    came_m3 = 90.0 / 3600.0 * (HOURS_3 - 1)
    assert quiet_alpha.sump.area_m2 * (level_m[-1] - level_m[0]) == pytest.approx(
        came_m3 - pumped_m3, abs=1e-3 * came_m3
    )


def test_a_main_that_is_shut_at_once_answers_as_joukowsky_says():
    """Without friction the head falls by B Q, is reversed after 2 L / a, and is back after 4 L / a."""
    reaches, impedance, flow = 10, 5000.0, 0.05
    heads_m, flows = np.full(reaches + 1, 20.0), np.full(reaches + 1, flow)
    seen_m = []
    for _ in range(8 * reaches):
        back_m = heads_m[1] - impedance * flows[1]
        advance(heads_m, flows, reaches, impedance, 0.0, 20.0)
        heads_m[0], flows[0] = back_m, 0.0
        seen_m.append(back_m)
    jump_m = impedance * flow
    np.testing.assert_allclose(seen_m[: 2 * reaches - 1], 20.0 - jump_m)
    np.testing.assert_allclose(seen_m[2 * reaches + 1 : 4 * reaches - 1], 20.0 + jump_m)
    np.testing.assert_allclose(seen_m[4 * reaches + 1 : 6 * reaches - 1], 20.0 - jump_m)


def test_a_column_that_parts_does_not_chatter():
    case = case_of((), "s85", np.random.default_rng(85), seconds=86_400)  # without cavities its valves never rest
    told, flow, *_ = passage_of(case).pump_record
    out = flow.sum(axis=0)
    moves = np.any(np.diff(told, prepend=0.0) != 0.0, axis=0)
    has_settled = ~np.convolve(moves, np.ones(30), "full")[: moves.size].astype(bool)
    assert has_settled.any()
    assert np.abs(np.diff(out, prepend=0.0))[has_settled].max() < 0.1 * out.max()


def test_a_long_main_speeds_up_as_a_rigid_column_does(quiet_alpha):
    column = 6000.0
    deviation = Deviation(name="water_inertia", parameters={"column_s2_m2": column})
    station = quiet_alpha.model_copy(update={"control": quiet_alpha.control.model_copy(update={"ramp_s": 60.0})})
    passage = passage_of(TruthCase(station=station, deviations=(deviation,), inflow=STEADY, seconds=HOURS_3))
    spec = passage.truth.spec
    assert spec.impedance[0] * spec.reaches[0] * TICK_S == pytest.approx(column, rel=0.01)
    command, flow = passage.pump_record[kernel.COMMAND, 0], passage.pump_record[kernel.FLOW, 0]
    begin = int(np.flatnonzero((command > 0.0) & (flow > 0.2 * spec.rated_flow[0]))[0])
    end = begin + 60

    def change(second, q):
        ratio = np.interp(second, np.arange(begin, end + 1), command[begin : end + 1])
        made_m = spec.shutoff_m[0] * ratio**2 + spec.linear[0] * ratio * q[0] + spec.square[0] * q[0] ** 2
        return [(made_m - spec.lift_m - spec.loss[0] * q[0] ** 2) / (column + spec.branch_inertance)]

    rigid = solve_ivp(change, (begin, end), [flow[begin]], t_eval=np.arange(begin, end + 1), max_step=0.5).y[0]
    assert np.max(np.abs(flow[begin : end + 1] - rigid)) < 0.05 * spec.rated_flow[0]


def test_a_motor_turns_where_its_torque_meets_the_load(quiet_alpha, monkeypatch):
    monkeypatch.setattr(machine, "load_torque", load_torque.py_func)  # compiled, only compiled code can call it
    spec = spec_of(quiet_alpha, machinery_of(quiet_alpha))
    flow = 0.8 * spec.rated_flow[0]
    speed = 0.9
    for _ in range(2000):
        speed = turned.py_func(spec, 1.0, speed, flow, spec.rated_flow[0])

    def left(slip):
        ratio = slip / spec.breakdown_slip
        pull = 2.0 * spec.breakdown / (ratio + 1.0 / ratio)
        return pull - load_torque.py_func(spec, (1.0 - slip) / spec.compensation, flow, spec.rated_flow[0])

    assert 1.0 - speed == pytest.approx(brentq(left, 1e-6, spec.breakdown_slip), rel=1e-6)


@pytest.mark.parametrize(("reynolds", "rough"), [(1e5, 1e-3), (1e6, 1e-4), (3e4, 5e-3)])
def test_friction_is_that_of_colebrook_within_what_the_explicit_form_promises(reynolds, rough):
    def left(factor):
        return 1.0 / math.sqrt(factor) + 2.0 * math.log10(rough / 3.7 + 2.51 / (reynolds * math.sqrt(factor)))

    assert friction_factor.py_func(reynolds, rough) == pytest.approx(brentq(left, 1e-3, 0.2), rel=0.03)


def test_the_library_is_whole_and_open_deviations_are_others():
    assert {name: ELASTIC_DEVIATIONS[name].component for name in ELASTIC_LIBRARY} == {
        name: EFFECTS[name].component for name in SEARCHED
    }
    assert len(ELASTIC_OPEN) >= 10
    assert not set(ELASTIC_OPEN) & set(EFFECTS)


def drawn(name, seed):
    """The same quiet station with and without a deviation."""
    case = case_of((name,), "s", np.random.default_rng(seed), seconds=28_800)
    case = replace(case, station=case.station.model_copy(update={"sensors": QUIET}))
    return case, replace(case, deviations=())


def of_station(columns, quantity):
    if quantity in columns:
        return columns[quantity]
    return np.concatenate([columns[f"pump{i}_{quantity}"] for i in range(1, 5) if f"pump{i}_{quantity}" in columns])


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", ELASTIC_DEVIATIONS)
def test_a_deviation_shows_where_it_must(name, seed):
    with_it, without = drawn(name, seed)
    columns, plain = run_elastic(with_it).columns, run_elastic(without).columns
    channel = with_it.deviations[0].parameters.get("channel")
    for signal in (channel,) if channel else ELASTIC_DEVIATIONS[name].signals:
        one, other = of_station(columns, signal), of_station(plain, signal)
        assert np.sqrt(np.mean((one - other) ** 2)) > 2e-3 * (other.max() - other.min()), signal


ONE_CHANNEL = {
    "supply_voltage_variation": "power_kw",
    "level_quantisation": "level_m",
    "flow_meter_gain": "flow_m3h",
    "flow_meter_lag": "flow_m3h",
    "flow_low_cutoff": "flow_m3h",
    "head_sensor_offset": "head_m",
    "electrode_fouling": "flow_m3h",
    "wandering_head_zero": "head_m",
    "warming_power_meter": "power_kw",
    "channel_delay": "",
    "report_by_exception": "",
    "skipping_clock": "",
}


@pytest.mark.long
@pytest.mark.parametrize("name", ONE_CHANNEL)
def test_a_deviation_of_a_channel_leaves_all_others_as_they_were(name):
    with_it, without = drawn(name, 3)
    columns, plain = run_elastic(with_it).columns, run_elastic(without).columns
    quantity = ONE_CHANNEL[name] or with_it.deviations[0].parameters["channel"]
    differing = {column for column in plain if not np.array_equal(columns[column], plain[column])}
    assert differing
    allowed = {quantity} | {f"pump{i}_{quantity}" for i in range(1, 5)}
    if quantity == "frequency_hz":
        allowed |= {f"pump{i}_running" for i in range(1, 5)}
    assert differing <= allowed


@pytest.mark.long
@pytest.mark.parametrize("name", ["pump_wear", "ragging"])
def test_what_wears_or_clogs_one_pump_leaves_the_other_on_its_curve(name):
    case, _ = drawn(name, 5)
    station = case.station.model_copy(update={"pump": (case.station.pump[0],) * 2, "control": case.station.control})
    levels = {key: getattr(station.control, key)[:2] for key in ("start_levels_m", "stop_levels_m")}
    if len(levels["start_levels_m"]) < 2:
        levels = {"start_levels_m": (1.5, 1.8), "stop_levels_m": (0.5, 0.7)}
    station = station.model_copy(update={"control": station.control.model_copy(update=levels)})
    parameters = case.deviations[0].parameters | {"pump": 2.0}
    passage = passage_of(
        replace(case, station=station, deviations=(Deviation(name=name, parameters=parameters),), initial_level_m=1.0)
    )
    at = settled(passage, 1)
    spec = passage.truth.spec
    off_m = []
    for i in (0, 1):
        own = at & (passage.pump_record[kernel.COMMAND, i] == 1.0)
        assert own.any()
        flow, head_m = passage.pump_record[kernel.FLOW, i, own], passage.pump_record[kernel.HEAD, i, own]
        off_m.append(np.max(np.abs(spec.shutoff_m[i] + (spec.linear[i] + spec.square[i] * flow) * flow - head_m)))
    assert off_m[0] < 0.01 * spec.rated_head_m[0] < 0.02 * spec.rated_head_m[0] < off_m[1]


def test_a_storm_tank_keeps_no_water_for_good(quiet_alpha):
    inflow = replace(STEADY, swing=0.5)
    deviation = Deviation(name="storm_tank", parameters={"weir_share": 1.2, "pump_share": 0.4})
    case = TruthCase(station=quiet_alpha, deviations=(deviation,), inflow=inflow, seconds=4 * 86_400)
    truth = passage_of(case).truth
    held_m3 = np.cumsum(truth.metered_inflow - truth.weather.inflow)
    assert held_m3.min() > -1e-9
    assert held_m3.max() > 10.0
    assert held_m3[28 * 3600] == pytest.approx(0.0, abs=1e-9), "empty after the first night"


def test_same_case_same_bytes_and_a_blind_recording_has_no_truth():
    case = case_of(("ragging", "flow_meter_lag"), "s", np.random.default_rng(9), seconds=3600, slow_share=0.3)
    one, other = run_elastic(case), run_elastic(case, truth=False)
    assert {name: values.tobytes() for name, values in one.columns.items()} == {
        name: values.tobytes() for name, values in other.columns.items()
    }
    assert other.truth == {}


def test_other_weather_has_the_same_machines_and_the_oracle_has_no_noise():
    case = case_of((), "s", np.random.default_rng(3), seconds=3600)
    one, other = passage_of(case), passage_of(replace(case, seed=case.seed + 1))
    assert one.truth.machinery == other.truth.machinery
    assert not np.array_equal(one.truth.metered_inflow, other.truth.metered_inflow)
    quiet, noisy = one.oracle().columns["level_m"], one.recording().columns["level_m"]
    assert np.std(noisy - quiet) == pytest.approx(case.station.sensors.level_noise_m, rel=0.1)


def test_noise_and_wandering_have_unit_variance_and_their_correlation():
    rng = np.random.default_rng(5)
    noise = sensor_noise(400_000, 0.4, 30.0, rng)
    assert np.std(noise) == pytest.approx(1.0, rel=0.03)
    assert np.corrcoef(noise[:-15], noise[15:])[0, 1] < 0.15 < np.corrcoef(noise[:-3], noise[3:])[0, 1]
    assert np.std(wandering(400_000, 50.0, rng)) == pytest.approx(1.0, rel=0.05)


def test_a_storm_has_its_peak_after_its_time():
    plan = TrueInflow(mean_m3h=0.0, swing=0.0, noise=0.0, rain_per_day=1.0, rain_m3h=50.0, rain_s=900.0)
    for seed in range(9):
        inflow = inflow_m3h(plan, 86_400, np.random.default_rng(seed))
        if inflow.any() and inflow.argmax() - np.flatnonzero(inflow)[0] == pytest.approx(900, abs=2):
            assert inflow.max() == pytest.approx(50.0, rel=0.3)
            return
    raise AssertionError("no storm that stands alone")


def test_what_is_sent_on_change_waits_for_its_pause_and_is_never_older_than_its_report():
    reading = np.array([0.0, 2.0, 4.0, 6.0, 6.5, 6.5, 6.5, 6.5])
    sent = arrived(reading, Instrument(threshold=1.0, pause_s=2.0, report_s=4.0))
    assert sent.tolist() == [0.0, 0.0, 4.0, 4.0, 4.0, 6.5, 6.5, 6.5]


@pytest.mark.long
def test_stations_differ_and_run_within_their_wells():
    pumps, layouts, unequal = set(), set(), set()
    for seed in range(24):
        case = case_of((), "s", np.random.default_rng(seed), seconds=21_600)
        station = case.station
        pumps.add(len(station.pump))
        layouts.add(station.mains[0].layout)
        unequal.add(len({pump.coefficients for pump in station.pump}) > 1)
        recording = run_elastic(case)
        assert all(np.isfinite(values).all() for values in recording.columns.values())
        assert recording.columns["level_m"].max() < station.control.start_levels_m[-1] + 1.0
        assert np.diff(recording.columns["pump1_running"]).any()
    assert (pumps, layouts, unequal) == ({1, 2, 3, 4}, {"common", "individual"}, {False, True})


def test_what_the_plant_does_not_have_is_refused(alpha):
    with pytest.raises(ValueError, match="deviation 'nope' is not one of"):
        passage_of(TruthCase(station=alpha, deviations=(Deviation(name="nope"),), seconds=10))
    control = alpha.control.model_copy(update={"dwell_s": 5.0})
    with pytest.raises(ValueError, match="plain on/off control"):
        passage_of(TruthCase(station=alpha.model_copy(update={"control": control}), seconds=10))
