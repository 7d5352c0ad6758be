"""The truth plant against closed forms, and each deviation where it must show and where it must not.

Tolerances: heads and flows to the remainder of the last Newton step, 1e-6; volumes to what
trapezoids between the seconds miss of a ramp, 1e-4.
"""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.station.station_file import Sensors
from wetwell.sim2real.truth import truth_plant
from wetwell.sim2real.truth.case import Deviation, TrueInflow, TruthCase, TruthFault
from wetwell.sim2real.truth.deviations import DEVIATIONS, LIBRARY, OPEN
from wetwell.sim2real.truth.sampling import case_of, faulty_case_of, inflow_of, station_of
from wetwell.sim2real.truth.telemetry import Channel, transmitted
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.effects import LIBRARY as SEARCHED

FOLDER = Path(truth_plant.__file__).parent
STEADY = TrueInflow(mean_m3h=90.0, swing=0.0, noise=0.0, rain_per_day=0.0)
QUIET = Sensors(flow_noise=0, head_noise=0, power_noise=0, inflow_noise=0, level_noise_m=0)
HOURS_6 = 21_600


def alpha_duty_m3h(own, shared, pumps):
    """Flow of each of n equal pumps by the quadratic formula, for losses own q² and shared (n q)²."""
    lift_m, c1, c2 = 34.0, -0.02333, -1.3333e-4 - own - shared * pumps**2
    return (-c1 - np.sqrt(c1**2 - 4.0 * c2 * lift_m)) / (2.0 * c2)


def test_duty_point_of_one_pump(quiet_alpha):
    recording = truth_plant.run(TruthCase(station=quiet_alpha, inflow=STEADY, seconds=HOURS_6))
    at_nominal = recording.columns["pump1_frequency_hz"] == 50.0
    settled = at_nominal & np.roll(at_nominal, 3)
    flow_m3h = alpha_duty_m3h(6e-4, 0.0, 1)
    np.testing.assert_allclose(recording.columns["pump1_flow_m3h"][settled], flow_m3h, rtol=1e-6)
    np.testing.assert_allclose(recording.columns["pump1_head_m"][settled], 2.0 + 6e-4 * flow_m3h**2, rtol=1e-6)


@pytest.mark.parametrize("shared", [0.6, 1.0])
def test_duty_point_of_two_pumps_on_a_header(quiet_alpha, shared):
    deviation = Deviation(name="common_header", parameters={"shared_fraction": shared})
    inflow = replace(STEADY, mean_m3h=210.0)
    case = TruthCase(station=quiet_alpha, deviations=(deviation,), inflow=inflow, seconds=HOURS_6)
    columns = truth_plant.run(case).columns
    at_nominal = np.array([columns[f"pump{i}_frequency_hz"] == 50.0 for i in (1, 2, 3)])
    for count in (1, 2):
        settled = (at_nominal.sum(0) == count) & (sum(columns[f"pump{i}_running"] for i in (1, 2, 3)) == count)
        settled &= np.roll(settled, 3)
        assert settled.any()
        flows_m3h = np.array([columns[f"pump{i}_flow_m3h"] for i in (1, 2, 3)])[:, settled][at_nominal[:, settled]]
        np.testing.assert_allclose(flows_m3h, alpha_duty_m3h(6e-4 * (1 - shared), 6e-4 * shared, count), rtol=1e-5)


def test_level_rises_by_the_inflow_while_idle_and_volumes_balance(quiet_alpha):
    recording = truth_plant.run(TruthCase(station=quiet_alpha, inflow=STEADY, seconds=HOURS_6))
    level_m, truth = recording.truth["truth_level_m"], recording.truth
    flow_m3h = sum(truth[f"truth_pump{i}_flow_m3h"] for i in (1, 2, 3))
    idle = (flow_m3h[:-1] == 0) & (flow_m3h[1:] == 0)
    assert idle.sum() > 1000
    np.testing.assert_allclose(np.diff(level_m)[idle], 90.0 / 3600.0 / 8.0, rtol=1e-9)
    steady = (np.abs(np.diff(flow_m3h)) < 1e-9) & (flow_m3h[1:] > 0)
    np.testing.assert_allclose(np.diff(level_m)[steady], (90.0 - flow_m3h[1:][steady]) / 3600.0 / 8.0, rtol=1e-6)
    pumped_m3 = np.sum(0.5 * (flow_m3h[1:] + flow_m3h[:-1])) / 3600.0
    assert 8.0 * (level_m[-1] - level_m[0]) == pytest.approx(
        90.0 * (HOURS_6 - 1) / 3600.0 - pumped_m3, abs=1e-4 * pumped_m3
    )


def test_a_column_of_water_speeds_up_as_the_equation_says(quiet_alpha):
    """With a main of inertia I the flow at full speed follows tanh; seen from where the ramp has ended."""
    inertia = 8000.0
    deviation = Deviation(name="water_inertia", parameters={"inertia_s2_m2": inertia})
    columns = truth_plant.run(
        TruthCase(station=quiet_alpha, deviations=(deviation,), inflow=STEADY, seconds=HOURS_6)
    ).columns
    flow = columns["pump1_flow_m3h"] / 3600.0
    begin = np.flatnonzero(np.diff((columns["pump1_frequency_hz"] == 50.0).astype(int)) == 1)[0] + 1
    c1, c2 = -0.02333 * 3600.0, -(1.3333e-4 + 6e-4) * 3600.0**2
    flows = [flow[begin]]
    for _ in range(20):
        now = flows[-1]
        for _ in range(2000):
            now += (34.0 + c1 * now + c2 * now**2) / inertia / 2000.0
        flows.append(now)
    np.testing.assert_allclose(flow[begin : begin + 21], flows, rtol=2e-3)


def test_no_module_of_the_truth_imports_the_simulator():
    for path in FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = (
                [node.module] if isinstance(node, ast.ImportFrom) else [a.name for a in getattr(node, "names", [])]
            )
            assert not any((name or "").startswith("wetwell.simulator") for name in names), path.name


def test_the_truth_has_every_effect_of_the_library_and_open_ones_beside():
    assert set(LIBRARY) == set(SEARCHED)
    assert {name: DEVIATIONS[name].component for name in LIBRARY} == {
        name: EFFECTS[name].component for name in SEARCHED
    }
    assert len(OPEN) >= 6
    assert not set(OPEN) & set(EFFECTS)


def drawn(name, seed):
    """The same quiet station with and without a deviation."""
    case = case_of((name,), "s", np.random.default_rng(seed), seconds=28_800)
    case = replace(case, station=case.station.model_copy(update={"sensors": QUIET}))
    return case, replace(case, deviations=())


def of_running(columns, quantity):
    return np.concatenate([columns[f"pump{i}_{quantity}"] for i in range(1, 5) if f"pump{i}_{quantity}" in columns])


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", DEVIATIONS)
def test_a_deviation_shows_where_it_must(name, seed):
    with_it, without = drawn(name, seed)
    columns, plain = truth_plant.run(with_it).columns, truth_plant.run(without).columns
    channel = with_it.deviations[0].parameters.get("channel")
    for signal in (channel,) if channel else DEVIATIONS[name].signals:
        one, other = (
            (columns[signal], plain[signal])
            if signal in columns
            else (of_running(columns, signal), of_running(plain, signal))
        )
        span = other.max() - other.min()
        assert np.sqrt(np.mean((one - other) ** 2)) > 2e-3 * span, signal


SENSOR_SIDE = {
    "load_dependent_power": "power_kw",
    "supply_voltage_variation": "power_kw",
    "level_quantisation": "level_m",
    "flow_meter_gain": "flow_m3h",
    "flow_meter_lag": "flow_m3h",
    "flow_low_cutoff": "flow_m3h",
    "head_sensor_offset": "head_m",
    "flow_meter_drift": "flow_m3h",
    "head_sensor_scale": "head_m",
    "power_meter_drift": "power_kw",
    "channel_delay": "",
    "report_by_exception": "",
    "clock_drift": "",
}


@pytest.mark.long
@pytest.mark.parametrize("name", SENSOR_SIDE)
def test_a_deviation_of_a_channel_leaves_all_others_as_they_were(name):
    with_it, without = drawn(name, 3)
    columns, plain = truth_plant.run(with_it).columns, truth_plant.run(without).columns
    quantity = SENSOR_SIDE[name] or with_it.deviations[0].parameters["channel"]
    differing = {column for column in plain if not np.array_equal(columns[column], plain[column])}
    assert differing
    allowed = {quantity} | {f"pump{i}_{quantity}" for i in range(1, 5)}
    if quantity == "frequency_hz":
        allowed |= {f"pump{i}_running" for i in range(1, 5)}
    assert differing <= allowed


@pytest.mark.long
@pytest.mark.parametrize("name", ["sump_area_profile", "unmetered_inflow", "control_delay", "threshold_shift"])
def test_what_moves_the_level_leaves_the_curves_alone(name):
    with_it, without = drawn(name, 4)
    for case in (with_it, without):
        columns = truth_plant.run(case).columns
        alone = sum(columns[f"pump{i}_running"] for i in range(1, len(case.station.pump) + 1)) == 1
        settled = alone & np.roll(alone, 20) & (columns["pump1_frequency_hz"] == 50.0)
        flow_m3h = columns["pump1_flow_m3h"][settled]
        c0, c1, c2 = case.station.pump[0].coefficients
        main = case.station.rising_main
        np.testing.assert_allclose(
            c0 + c1 * flow_m3h + c2 * flow_m3h**2,
            main.static_head_m + main.friction_h2_m5 * flow_m3h**2,
            rtol=1e-6,
        )


@pytest.mark.parametrize("name", ["second_sump", "unmetered_inflow"])
def test_what_flows_in_beside_the_meter_moves_the_level_alone(name):
    with_it, without = drawn(name, 4)
    columns, plain = truth_plant.run(with_it).columns, truth_plant.run(without).columns
    np.testing.assert_array_equal(columns["inflow_m3h"], plain["inflow_m3h"])
    assert np.max(np.abs(columns["level_m"] - plain["level_m"])) > 0.01


def test_same_case_same_bytes_and_a_blind_recording_has_no_truth():
    case = case_of(("ragging", "flow_meter_lag"), "s", np.random.default_rng(9), seconds=3600, slow_share=0.3)
    one, other = truth_plant.run(case), truth_plant.run(case, truth=False)
    assert {name: values.tobytes() for name, values in one.columns.items()} == {
        name: values.tobytes() for name, values in other.columns.items()
    }
    assert other.truth == {}


def test_slow_noise_keeps_the_spread(alpha):
    case = TruthCase(station=alpha, inflow=STEADY, seconds=86_400, slow_share=0.5, slow_s=30.0)
    recording = truth_plant.run(case)
    error = recording.columns["inflow_m3h"] / 90.0 - 1.0
    assert np.std(error) == pytest.approx(0.01, rel=0.1)
    assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(0.5 * np.exp(-1 / 30), abs=0.05)


def test_stations_differ_and_run():
    names = set()
    for seed in range(30):
        rng = np.random.default_rng(seed)
        station = station_of("s", rng, needs_two_pumps=seed % 2 == 0)
        names.add(len(station.pump))
        assert len(station.pump) > 1 or seed % 2
        case = TruthCase(station=station, inflow=inflow_of(station, rng), seconds=HOURS_6, seed=seed)
        recording = truth_plant.run(case)
        assert all(np.isfinite(values).all() for values in recording.columns.values())
        assert recording.columns["level_m"].max() < station.control.start_levels_m[-1] + 1.0
        assert np.diff(recording.columns["pump1_running"]).any()
    assert names == {1, 2, 3, 4}


def test_unknown_deviation_and_unfit_station_are_refused(alpha):
    with pytest.raises(ValueError, match="deviation 'nope' is not one of"):
        truth_plant.run(TruthCase(station=alpha, deviations=(Deviation(name="nope"),), seconds=10))
    control = alpha.control.model_copy(update={"dwell_s": 5.0})
    with pytest.raises(ValueError, match="plain on/off control"):
        truth_plant.run(TruthCase(station=alpha.model_copy(update={"control": control}), seconds=10))


def test_faults_act_on_their_pump_and_are_told_in_the_truth(quiet_alpha):
    faults = (
        TruthFault(kind="blockage", pump=2, start_s=10_000, end_s=20_000, size=0.1),
        TruthFault(kind="clogging", start_s=30_000, end_s=35_000, size=0.5),
        TruthFault(kind="sensor_gap", pump=1, channel="head_m", start_s=38_000, end_s=39_000),
    )
    recording = truth_plant.run(TruthCase(station=quiet_alpha, faults=faults, inflow=STEADY, seconds=43_200))
    truth = recording.truth
    assert truth["truth_pump1_state"][[0, 25_000, 36_000, 40_000]].tolist() == [
        "normal",
        "normal",
        "system_fault",
        "system_fault",
    ]
    assert truth["truth_pump2_state"][[0, 25_000, 36_000]].tolist() == [
        "normal",
        "pump_fault",
        "pump_and_system_fault",
    ]
    assert truth["truth_pump2_speed_factor"][[0, 15_000, 30_000]] == pytest.approx([1.0, 0.95, 0.9])
    assert np.isnan(recording.columns["pump1_head_m"][38_000:]).all()
    assert np.isfinite(recording.columns["pump2_head_m"]).all()


@pytest.mark.parametrize("kind", ["sensor_stuck", "sensor_bias", "sensor_drift"])
@pytest.mark.parametrize("channel", ["level_m", "flow_m3h"])
def test_sensor_faults_spoil_their_channel_from_their_start_on(kind, channel, quiet_alpha):
    pump = 0 if channel == "level_m" else 1
    fault = TruthFault(kind=kind, channel=channel, pump=pump, start_s=10_000, end_s=12_000, size=0.3)
    case = TruthCase(station=quiet_alpha, inflow=STEADY, seconds=HOURS_6)
    plain, spoilt = truth_plant.run(case), truth_plant.run(replace(case, faults=(fault,)))
    column = channel if pump == 0 else f"pump1_{channel}"
    np.testing.assert_array_equal(spoilt.columns[column][:10_000], plain.columns[column][:10_000])
    assert not np.array_equal(spoilt.columns[column], plain.columns[column])
    assert spoilt.truth["truth_pump1_state"][20_000] == "sensor_fault"
    assert spoilt.truth["truth_pump2_state"][20_000] == ("sensor_fault" if pump == 0 else "normal")
    if pump:
        np.testing.assert_array_equal(spoilt.columns["level_m"], plain.columns["level_m"])


def test_a_case_with_faults_is_healthy_while_a_detector_learns():
    case = faulty_case_of(("blockage", "clogging"), "s", np.random.default_rng(4), seconds=86_400)
    truth = truth_plant.run(case).truth
    assert set(truth["truth_state"][:HOURS_6]) == {"normal"}
    assert truth["truth_state"][-1] == "pump_and_system_fault"
    with pytest.raises(ValueError, match="needs 25200"):
        faulty_case_of(("blockage",), "s", np.random.default_rng(4), seconds=20_000)


def test_report_by_exception_holds_a_value_until_it_has_moved_or_a_time_is_over():
    reading = np.array([0.0, 0.4, 0.9, 1.2, 1.1, 1.1, 1.1, 1.1])
    sent = transmitted(reading, Channel(deadband=1.0, report_s=3.0))
    assert sent.tolist() == [0.0, 0.0, 0.9, 0.9, 0.9, 1.1, 1.1, 1.1]
