"""Shape of the faults over time, what they do to the operating point, and what the truth columns say of them."""

import math
from typing import Literal

import numpy as np
import pytest
from scipy.optimize import brentq

from wetwell.protocols.timestamps import NS_PER_S
from wetwell.simulator.faults.profile import Profile
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.pump.check_valve_leak import CheckValveLeak
from wetwell.simulator.faults.pump.drive_trip import DriveTrip
from wetwell.simulator.faults.pump.impeller_wear import ImpellerWear
from wetwell.simulator.faults.pump.ragging import Ragging
from wetwell.simulator.faults.pump.wear_ring_leakage import WearRingLeakage
from wetwell.simulator.faults.rising_main.air_pocket import AirPocket
from wetwell.simulator.faults.rising_main.partly_closed_valve import PartlyClosedValve
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.faults.telemetry.frozen_plc import FrozenPlc
from wetwell.simulator.faults.telemetry.sensor_bias import SensorBias
from wetwell.simulator.faults.telemetry.sensor_drift import SensorDrift
from wetwell.simulator.faults.telemetry.sensor_noise import SensorNoise
from wetwell.simulator.faults.telemetry.sensor_stuck import SensorStuck
from wetwell.simulator.forcing import healthy_forcing
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.scenario import DEFAULT_START_NS, Scenario
from wetwell.simulator.simulation import Simulation

Layout = Literal["individual", "common"]
STATIC_M, FRICTION = 2.0, 6e-4
C0, C1, C2 = 36.0, -0.02333, -1.3333e-4


def run(station, *faults, seconds=3000, inflow_m3h=900.0, initial_level_m=3.0, layout: Layout = "individual"):
    """A station under an inflow that, where nothing else is said, keeps all pumps on."""
    main = station.rising_main.model_copy(update={"layout": layout})
    flood = RecordedInflow(time_s=[0.0], flow_m3h=[inflow_m3h])
    scenario = Scenario(name="flood", initial_level_m=initial_level_m, inflow=flood, fault=faults)
    return Simulation(station.model_copy(update={"rising_main": main}), scenario, seed=1).advance(seconds)


def at_full_frequency(recording, pump, from_s):
    """Flow and head of a pump while the drive gives 50 Hz, from some second on."""
    full = recording.columns[f"pump{pump}_frequency_hz"] == 50
    full[:from_s] = False
    assert full.sum() > 100
    return recording.columns[f"pump{pump}_flow_m3h"][full], recording.columns[f"pump{pump}_head_m"][full]


@pytest.mark.parametrize("after", ["hold", "clear"])
def test_ramp_rises_linearly_then_holds_or_clears(after):
    ramp = Profile(start_s=100, end_s=300, after=after)
    time_s = np.array([0.0, 99.0, 100.0, 101.0, 150.0, 200.0, 299.0, 300.0, 300.5, 301.0, 1e6])
    last = 1.0 if after == "hold" else 0.0
    expected = [0, 0, 0, 0.005, 0.25, 0.5, 0.995, 1, last, last, last]
    assert ramp.share(time_s) == pytest.approx(expected, abs=1e-15)
    active = [False, False, True, True, True, True, True, True, *[after == "hold"] * 3]
    assert ramp.is_active(time_s).tolist() == active


@pytest.mark.parametrize("after", ["hold", "clear"])
def test_step_is_full_at_once(after):
    step = Profile(start_s=100, end_s=300, after=after, shape="step")
    time_s = np.array([0.0, 99.0, 100.0, 200.0, 300.0, 301.0, 1e6])
    last = 1.0 if after == "hold" else 0.0
    assert step.share(time_s).tolist() == [0, 0, 1, 1, 1, last, last]
    assert (step.is_active(time_s) == (step.share(time_s) > 0)).all()


@pytest.mark.parametrize(("duty", "on_s"), [(0.0, 0), (0.25, 25), (1.0, 100)])
def test_intermittent_comes_and_goes(duty, on_s):
    time_s = np.arange(1000.0)
    on = (time_s >= 130) & ((time_s - 130) % 100 < on_s)
    for after in ("hold", "clear"):
        part = Profile(start_s=130, end_s=449, after=after, shape="intermittent", period_s=100, duty=duty)
        expected = on if after == "hold" else on & (time_s <= 449)
        assert (part.share(time_s) == expected).all()
        assert (part.is_active(time_s) == expected).all()


def test_blockage_takes_speed_from_its_own_pump_only():
    forcing = healthy_forcing(np.zeros(4), pumps=3, mains=1)
    Blockage(pump=2, start_s=0, end_s=2, speed_loss=0.4).apply(forcing, np.arange(4.0))
    assert forcing.speed_factor[1] == pytest.approx([1.0, 0.8, 0.6, 0.6])
    assert (forcing.speed_factor[[0, 2]] == 1).all()
    assert (forcing.friction_factor == 1).all()
    assert (forcing.static_rise_m == 0).all()


def test_clogging_raises_friction_and_static_head():
    forcing = healthy_forcing(np.zeros(4), pumps=3, mains=1)
    PipeClogging(start_s=0, end_s=2, friction_rise=1.0, static_rise_m=0.5).apply(forcing, np.arange(4.0))
    assert forcing.friction_factor[0] == pytest.approx([1.0, 1.5, 2.0, 2.0])
    assert forcing.static_rise_m[0] == pytest.approx([0.0, 0.25, 0.5, 0.5])
    assert (forcing.speed_factor == 1).all()


def test_faults_at_the_same_time_combine():
    forcing = healthy_forcing(np.zeros(2), pumps=1, mains=1)
    for fault in (
        Blockage(pump=1, start_s=0, end_s=1, speed_loss=0.5),
        Blockage(pump=1, start_s=0, end_s=1, speed_loss=0.2),
        PipeClogging(start_s=0, end_s=1, friction_rise=1.0, static_rise_m=0.5),
        PipeClogging(start_s=0, end_s=1, friction_rise=0.5, static_rise_m=0.25),
    ):
        fault.apply(forcing, np.array([0.0, 1.0]))
    assert forcing.speed_factor[0] == pytest.approx([1.0, 0.4])
    assert forcing.friction_factor[0] == pytest.approx([1.0, 3.0])
    assert forcing.static_rise_m[0] == pytest.approx([0.0, 0.75])


def test_blockage_slides_along_the_system_curve(quiet_alpha):
    """The pump's flow falls, the rising main sees nothing but that: H - Hs - k Q² stays zero."""
    recording = run(quiet_alpha, Blockage(pump=1, start_s=200, end_s=2200, speed_loss=0.4))
    flow_m3h, head_m = at_full_frequency(recording, 1, from_s=50)
    np.testing.assert_allclose(head_m - STATIC_M - FRICTION * flow_m3h**2, 0.0, atol=1e-9)
    assert flow_m3h.max() - flow_m3h.min() > 60
    assert (np.diff(flow_m3h) <= 0).all()
    pump_residual_m = head_m - (C0 + C1 * flow_m3h + C2 * flow_m3h**2)
    assert pump_residual_m[0] == pytest.approx(0.0, abs=1e-9)
    assert pump_residual_m[-1] < -10
    healthy_m3h, _ = at_full_frequency(recording, 2, from_s=50)
    assert np.ptp(healthy_m3h) == 0


def test_blockage_is_seen_neither_in_frequency_nor_in_power(quiet_alpha):
    healthy = run(quiet_alpha)
    blocked = run(quiet_alpha, Blockage(pump=1, start_s=200, end_s=2200, speed_loss=0.4))
    for name in ("pump1_frequency_hz", "pump1_power_kw"):
        assert blocked.columns[name].tolist() == healthy.columns[name].tolist()


def test_clogging_climbs_along_the_pump_curve(quiet_alpha):
    """Flow falls and head rises on the healthy curve: H - c0 - c1 Q - c2 Q² stays zero."""
    recording = run(quiet_alpha, PipeClogging(start_s=200, end_s=2200, friction_rise=1.0, static_rise_m=0.5))
    for pump in (1, 2, 3):
        flow_m3h, head_m = at_full_frequency(recording, pump, from_s=100)
        np.testing.assert_allclose(head_m, C0 + C1 * flow_m3h + C2 * flow_m3h**2, rtol=0, atol=1e-9)
        assert (np.diff(head_m) >= 0).all()
        assert head_m[-1] - head_m[0] > 3
        assert head_m[-1] == pytest.approx(STATIC_M + 0.5 + 2 * FRICTION * flow_m3h[-1] ** 2, abs=1e-9)


def test_paper_clogging_end_point(quiet_alpha):
    """ERRATA of the paper: 150 m³/h with twice the friction and a static head of 2.5 m."""
    recording = run(quiet_alpha, PipeClogging(start_s=10, end_s=20, friction_rise=1.0, static_rise_m=0.5))
    flow_m3h, head_m = at_full_frequency(recording, 1, from_s=50)
    assert flow_m3h[-1] == pytest.approx(150.0, abs=0.5)
    assert head_m[-1] == pytest.approx(2.5 + 1.2e-3 * flow_m3h[-1] ** 2)


def test_on_a_header_a_blocked_pump_may_not_open_its_check_valve(quiet_alpha):
    blocked = run(quiet_alpha, Blockage(pump=1, start_s=10, end_s=20, speed_loss=0.4), layout="common")
    flow_m3h, head_m = at_full_frequency(blocked, 1, from_s=100)
    assert (flow_m3h == 0).all()
    assert head_m == pytest.approx(36.0 * 0.6**2)
    assert head_m[0] < at_full_frequency(blocked, 2, from_s=100)[1][0]


def test_cleared_faults_leave_no_trace(quiet_alpha):
    healthy = run(quiet_alpha)
    cleared = run(
        quiet_alpha,
        Blockage(pump=1, start_s=200, end_s=1000, after="clear"),
        PipeClogging(start_s=300, end_s=1100, static_rise_m=0.5, after="clear"),
    )
    for name in ("pump1_flow_m3h", "pump2_head_m", "pump3_flow_m3h"):
        assert cleared.columns[name][1101:].tolist() == healthy.columns[name][1101:].tolist()
        assert cleared.columns[name][900] != healthy.columns[name][900] or name != "pump1_flow_m3h"


def test_truth_columns_agree_with_the_profiles(alpha):
    blockage = Blockage(pump=2, start_s=100, end_s=500, speed_loss=0.3, after="clear")
    clogging = PipeClogging(start_s=300, end_s=700, friction_rise=0.8, static_rise_m=0.5, after="hold")
    recording = run(alpha, blockage, clogging, seconds=1000)
    truth, time_s = recording.truth, np.arange(1000.0)
    ramp = np.where((time_s >= 100) & (time_s <= 500), (time_s - 100) / 400, 0.0)
    assert truth["truth_pump2_speed_factor"] == pytest.approx(1 - 0.3 * ramp)
    assert (truth["truth_pump1_speed_factor"] == 1).all()
    rise = np.clip((time_s - 300) / 400, 0, 1)
    assert truth["truth_friction_factor"] == pytest.approx(1 + 0.8 * rise)
    assert truth["truth_static_rise_m"] == pytest.approx(0.5 * rise)

    def states(name):
        """Seconds at which the state changes, and the state from there on."""
        column = truth[name]
        changes = [0, *(np.flatnonzero(column[1:] != column[:-1]) + 1)]
        return [(int(second), str(column[second])) for second in changes]

    both, system = (300, "pump_and_system_fault"), (501, "system_fault")
    assert states("truth_state") == [(0, "normal"), (100, "pump_fault"), both, system]
    assert states("truth_pump2_state") == [(0, "normal"), (100, "pump_fault"), both, system]
    assert states("truth_pump1_state") == [(0, "normal"), (300, "system_fault")]
    assert states("truth_pump3_state") == states("truth_pump1_state")
    assert recording.time_ns[0] == DEFAULT_START_NS
    assert (np.diff(recording.time_ns) == NS_PER_S).all()


def test_true_operating_point_is_the_measured_one_without_noise(quiet_alpha):
    recording = run(quiet_alpha, Blockage(pump=1, start_s=0, end_s=500), seconds=800)
    for name in ("level_m", "inflow_m3h", "pump1_flow_m3h", "pump1_head_m", "pump3_flow_m3h"):
        assert recording.columns[name].tolist() == recording.truth[f"truth_{name}"].tolist()


def test_noise_has_the_stated_deviations(alpha):
    """Level additive, the others relative. Five standard errors of a deviation from 2000 draws are 8 %."""
    recording = run(alpha, seconds=2100, inflow_m3h=900.0)
    full = slice(100, None)
    level_error_m = (recording.columns["level_m"] - recording.truth["truth_level_m"])[full]
    assert np.std(level_error_m) == pytest.approx(0.002, rel=0.08)
    for name in ("inflow_m3h", "pump1_flow_m3h", "pump1_head_m"):
        ratio = recording.columns[name][full] / recording.truth[f"truth_{name}"][full]
        assert np.std(ratio) == pytest.approx(0.01, rel=0.08)
        assert np.mean(ratio) == pytest.approx(1.0, abs=5 * 0.01 / math.sqrt(2000))
    power_kw = recording.columns["pump1_power_kw"][full]
    assert np.std(power_kw) / np.mean(power_kw) == pytest.approx(0.01, rel=0.08)


def test_truth_can_be_left_out(alpha):
    scenario = Scenario(name="plain")
    with_truth = Simulation(alpha, scenario, seed=3).advance(200)
    without = Simulation(alpha, scenario, seed=3).advance(200, truth=False)
    assert with_truth.truth
    assert without.truth == {}
    assert all((without.columns[name] == column).all() for name, column in with_truth.columns.items())


@pytest.mark.parametrize(
    "fault",
    [Blockage(pump=4, start_s=0, end_s=1), SensorStuck(channel="flow_m3h", pump=4, start_s=0, end_s=1)],
    ids=lambda fault: fault.kind,
)
def test_a_fault_of_a_pump_that_is_not_there_is_refused(alpha, fault):
    faults = (Blockage(pump=3, start_s=0, end_s=1), fault)
    with pytest.raises(ValueError, match=r"fault\[2\]\.pump: got 4, station 'alpha' has 3 pumps$"):
        Simulation(alpha, Scenario(name="wrong", fault=faults), seed=1)


def healthy_head_m(flow_m3h):
    return C0 + C1 * flow_m3h + C2 * flow_m3h**2


def duty_m3h(pump_head_m=healthy_head_m, static_m=STATIC_M, friction=FRICTION):
    """Flow at which pump and system meet, found by bracketing alone."""
    return brentq(lambda flow_m3h: pump_head_m(flow_m3h) - static_m - friction * flow_m3h**2, 0.0, 500.0, xtol=1e-12)


@pytest.mark.parametrize(
    ("fault", "expected_m3h"),
    [
        (ImpellerWear(pump=1, start_s=10, end_s=20, head_loss=0.2), duty_m3h(lambda q: 0.8 * healthy_head_m(q))),
        (WearRingLeakage(pump=1, start_s=10, end_s=20, leak_m3h=25), duty_m3h(lambda q: healthy_head_m(q + 25))),
        (
            Ragging(pump=1, start_s=10, end_s=20, speed_loss=0.3, duty=1.0),
            duty_m3h(lambda q: C0 * 0.49 + C1 * 0.7 * q + C2 * q**2),
        ),
        (AirPocket(start_s=10, end_s=20, static_rise_m=3), duty_m3h(static_m=STATIC_M + 3)),
        (
            PartlyClosedValve(start_s=10, end_s=20, opening=0.2, valve_share=0.1),
            duty_m3h(friction=FRICTION * (1 + 0.1 * 24)),
        ),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_duty_point_under_a_fault_is_that_of_brentq(quiet_alpha, fault, expected_m3h):
    """And a fault of pump 1 leaves the other pumps where they were, one of the main moves them all."""
    recording = run(quiet_alpha, fault, seconds=200)
    flow_m3h, _ = at_full_frequency(recording, 1, from_s=50)
    np.testing.assert_allclose(flow_m3h, expected_m3h, rtol=1e-9)
    others_m3h, _ = at_full_frequency(recording, 2, from_s=50)
    np.testing.assert_allclose(others_m3h, duty_m3h() if hasattr(fault, "pump") else expected_m3h, rtol=1e-9)


@pytest.mark.parametrize(
    "fault",
    [
        ImpellerWear(pump=1, start_s=100, end_s=500, head_loss=0.3),
        WearRingLeakage(pump=1, start_s=100, end_s=500, leak_m3h=60),
    ],
    ids=lambda fault: fault.kind,
)
def test_wear_slides_down_the_system_curve(quiet_alpha, fault):
    flow_m3h, head_m = at_full_frequency(run(quiet_alpha, fault, seconds=700), 1, from_s=50)
    np.testing.assert_allclose(head_m, STATIC_M + FRICTION * flow_m3h**2, rtol=1e-9)
    assert (np.diff(flow_m3h) <= 1e-9).all()
    assert flow_m3h[0] - flow_m3h[-1] > 10


def test_a_closing_valve_climbs_along_the_pump_curve(quiet_alpha):
    recording = run(quiet_alpha, PartlyClosedValve(start_s=100, end_s=500, opening=0.1), seconds=700)
    flow_m3h, head_m = at_full_frequency(recording, 2, from_s=50)
    np.testing.assert_allclose(head_m, healthy_head_m(flow_m3h), rtol=1e-9)
    assert (np.diff(head_m) >= -1e-9).all()
    assert head_m[-1] - head_m[0] > 5


def test_ragging_comes_and_goes_with_its_period(quiet_alpha):
    ragging = Ragging(pump=1, start_s=100, end_s=200, speed_loss=0.3, period_s=60, duty=0.5)
    flow_m3h = run(quiet_alpha, ragging, seconds=460).columns["pump1_flow_m3h"][100:]
    ragged = np.arange(360) % 60 < 30
    assert flow_m3h[~ragged] == pytest.approx(duty_m3h())
    assert np.ptp(flow_m3h[ragged]) < 1e-9
    assert flow_m3h[ragged][0] < 0.8 * duty_m3h()


def test_a_leaking_check_valve_fills_the_wet_well_while_its_pump_stands(quiet_alpha):
    """Root of the static head behind the valve, seen in the level only; a pump that runs holds its valve open."""
    faults = [CheckValveLeak(pump=2, start_s=0, end_s=1, leak_m3h=10, shape="step")]
    idle = run(quiet_alpha, *faults, seconds=100, inflow_m3h=5.0, initial_level_m=0.6)
    rate_m3h = np.diff(idle.columns["level_m"]) * quiet_alpha.sump.area_m2 * 3600
    assert rate_m3h == pytest.approx(5 + 10 * math.sqrt(STATIC_M))
    assert idle.columns["inflow_m3h"] == pytest.approx(5.0)
    full, healthy = (run(quiet_alpha, *some, seconds=200).columns["level_m"] for some in (faults, []))
    assert np.diff(full)[-50:] == pytest.approx(np.diff(healthy)[-50:])


def test_a_tripped_drive_stops_at_once_and_another_pump_takes_over(quiet_alpha):
    trip = DriveTrip(pump=1, start_s=100, end_s=1500, after="clear")
    recording = run(quiet_alpha, trip, seconds=4000, inflow_m3h=100.0, initial_level_m=1.7)
    frequency_hz = recording.columns["pump1_frequency_hz"]
    assert frequency_hz[100] == 50
    assert (frequency_hz[101:1501] == 0).all()
    assert (recording.columns["pump1_flow_m3h"][101:1501] == 0).all()
    assert recording.columns["pump2_frequency_hz"][:101].max() == 0
    assert recording.columns["pump2_frequency_hz"][101:1501].max() == 50
    assert frequency_hz[1501:].max() == 50


def test_pumps_that_are_all_tripped_let_the_level_rise(quiet_alpha):
    trips = [DriveTrip(pump=pump, start_s=0, end_s=1) for pump in (1, 2, 3)]
    recording = run(quiet_alpha, *trips, seconds=600, inflow_m3h=360.0)
    assert recording.columns["level_m"][-1] == pytest.approx(3.0 + 599 * 0.1 / 8)
    assert max(recording.columns[f"pump{i}_frequency_hz"].max() for i in (1, 2, 3)) == 0


@pytest.mark.parametrize(("start_s", "is_pumping"), [(100, True), (5, False)], ids=["pumping", "filling"])
def test_a_frozen_plc_repeats_itself_while_the_level_runs_away(alpha, start_s, is_pumping):
    """With noise: every value repeats to the last bit. Pumps go on, or stand, as they were."""
    frozen = FrozenPlc(start_s=start_s, end_s=700, after="clear")
    level_m = 1.7 if is_pumping else 1.0
    recording = run(alpha, frozen, seconds=1000, inflow_m3h=30.0, initial_level_m=level_m)
    for name, column in recording.columns.items():
        assert np.ptp(column[start_s - 1 : 701]) == 0, name
    assert np.ptp(recording.columns["level_m"][701:]) > 0
    true_level_m, pumped_m3h = recording.truth["truth_level_m"], recording.truth["truth_pump1_flow_m3h"]
    if is_pumping:
        water = slice(start_s, np.flatnonzero(true_level_m < 0.1)[0])
        assert pumped_m3h[water] == pytest.approx(duty_m3h())
        assert true_level_m[690:700] == pytest.approx(0.0, abs=0.05)
    else:
        assert (pumped_m3h[:701] == 0).all()
        assert true_level_m[700] == pytest.approx(1.0 + 700 * 30 / 3600 / 8)
    assert set(recording.truth["truth_state"][start_s:701]) == {"sensor_fault"}


def test_a_stuck_sensor_repeats_its_last_reading_and_nothing_else_changes(alpha):
    stuck = SensorStuck(channel="flow_m3h", pump=2, start_s=300, end_s=500, after="clear")
    healthy, faulty = run(alpha, seconds=700), run(alpha, stuck, seconds=700)
    flow_m3h = faulty.columns["pump2_flow_m3h"]
    assert (flow_m3h[300:501] == healthy.columns["pump2_flow_m3h"][299]).all()
    for name, column in healthy.columns.items():
        same = column == faulty.columns[name]
        assert same[:300].all()
        assert same[501:].all()
        assert name == "pump2_flow_m3h" or same.all()


def test_a_stuck_level_sensor_makes_the_controller_overrun(quiet_alpha):
    """Stuck while a pump runs: it goes on under the stop level. Stuck low: none starts, the level rises."""
    stuck = SensorStuck(channel="level_m", start_s=100, end_s=200)
    running = run(quiet_alpha, stuck, seconds=900, inflow_m3h=100.0, initial_level_m=1.7)
    assert (running.columns["level_m"][99:] == running.columns["level_m"][99]).all()
    assert running.columns["pump1_frequency_hz"][100:].min() == 50
    assert running.truth["truth_level_m"].min() < 0.4
    waiting = run(quiet_alpha, stuck, seconds=900, inflow_m3h=100.0, initial_level_m=0.6)
    assert waiting.columns["pump1_frequency_hz"].max() == 0
    assert waiting.truth["truth_level_m"][-1] > 2


def test_a_stuck_sensor_gives_the_same_in_single_seconds(quiet_alpha):
    """The pump stops while its meter is stuck: live it must repeat as it does in a batch."""
    stuck = SensorStuck(channel="flow_m3h", start_s=100, end_s=800, after="clear")
    inflow = RecordedInflow(time_s=[0.0], flow_m3h=[20.0])
    scenario = Scenario(name="one", initial_level_m=1.7, inflow=inflow, fault=(stuck,))
    batch = Simulation(quiet_alpha, scenario, seed=1).advance(900)
    live = Simulation(quiet_alpha, scenario, seed=1)
    seconds = [live.advance(1) for _ in range(900)]
    assert batch.columns["pump1_frequency_hz"][799] == 0
    assert batch.columns["pump1_flow_m3h"][799] > 0
    for name, column in batch.columns.items():
        assert np.concatenate([second.columns[name] for second in seconds]).tobytes() == column.tobytes(), name


def test_drift_has_its_slope_and_holds(quiet_alpha):
    drift = SensorDrift(channel="head_m", pump=1, start_s=200, end_s=1100, bias_per_hour=-4.0)
    recording = run(quiet_alpha, drift, seconds=1500)
    error_m = recording.columns["pump1_head_m"] - recording.truth["truth_pump1_head_m"]
    hours = (np.clip(np.arange(1500), 200, 1100) - 200) / 3600
    assert error_m == pytest.approx(-4.0 * hours, abs=1e-12)
    np.testing.assert_array_equal(recording.columns["pump2_head_m"], recording.truth["truth_pump2_head_m"])


def test_bias_shifts_its_channel(quiet_alpha):
    """On all pumps; a pump that stands reads 0 all the same. A level read too high starts the pump early."""
    bias = SensorBias(channel="flow_m3h", start_s=200, end_s=300, bias=12.5)
    recording = run(quiet_alpha, bias, seconds=500, inflow_m3h=100.0, initial_level_m=1.7)
    running = recording.columns["pump1_frequency_hz"] > 0
    error_m3h = recording.columns["pump1_flow_m3h"] - recording.truth["truth_pump1_flow_m3h"]
    assert error_m3h == pytest.approx(np.where(running & (np.arange(500) >= 200), 12.5, 0.0))
    assert (recording.columns["pump3_flow_m3h"] == 0).all()
    high = SensorBias(channel="level_m", start_s=0, end_s=1, bias=0.3)
    recording = run(quiet_alpha, high, seconds=900, inflow_m3h=100.0, initial_level_m=1.0)
    start = np.flatnonzero(recording.columns["pump1_frequency_hz"])[0]
    assert recording.truth["truth_level_m"][start] == pytest.approx(1.3, abs=0.01)


def test_noise_grows_by_its_factor(alpha):
    """The same draws, three times as large."""
    noise = SensorNoise(channel="head_m", pump=1, start_s=100, end_s=200, factor=3)
    healthy, faulty = run(alpha, seconds=400), run(alpha, noise, seconds=400)
    errors = [r.columns["pump1_head_m"][50:] / r.truth["truth_pump1_head_m"][50:] - 1 for r in (healthy, faulty)]
    assert errors[1][50:] == pytest.approx(3 * errors[0][50:])
    assert errors[1][:50] == pytest.approx(errors[0][:50])


MANY = (
    Blockage(pump=1, start_s=100, end_s=300, after="clear"),
    ImpellerWear(pump=1, start_s=200, end_s=400),
    DriveTrip(pump=2, start_s=250, end_s=350, after="clear"),
    Ragging(pump=3, start_s=50, end_s=500, period_s=40),
    CheckValveLeak(pump=2, start_s=0, end_s=100),
    WearRingLeakage(pump=3, start_s=0, end_s=500),
    PipeClogging(start_s=300, end_s=400),
    AirPocket(start_s=300, end_s=500, shape="step"),
    PartlyClosedValve(start_s=10, end_s=500, shape="intermittent", period_s=90),
    SensorDrift(channel="level_m", start_s=0, end_s=600, bias_per_hour=0.2),
    SensorNoise(channel="power_kw", start_s=0, end_s=600),
    SensorBias(channel="head_m", pump=2, start_s=0, end_s=600, bias=-2),
    SensorStuck(channel="flow_m3h", pump=3, start_s=100, end_s=200, after="clear"),
    FrozenPlc(start_s=550, end_s=580, after="clear"),
)


def test_any_number_of_faults_at_once_in_blocks_of_any_length(alpha):
    scenario = Scenario(name="many", initial_level_m=3.0, fault=MANY)
    whole = Simulation(alpha, scenario, seed=5).advance(600)
    parts = Simulation(alpha, scenario, seed=5)
    blocks = [parts.advance(seconds) for seconds in (1, 99, 0, 151, 300, 1, 48)]
    for kind in ("columns", "truth"):
        for name, column in getattr(whole, kind).items():
            joined = np.concatenate([getattr(block, kind)[name] for block in blocks])
            assert joined.tobytes() == column.tobytes(), name
    assert all(np.isfinite(column).all() for column in whole.columns.values())


def test_faults_of_no_strength_change_no_bit(alpha):
    """Of what is measured: states and names still tell of a fault that does nothing."""
    nothing = [fault.model_copy(update=fault.neutral) for fault in MANY]
    healthy, weak = run(alpha, seconds=600), run(alpha, *nothing, seconds=600)
    for name, column in healthy.columns.items():
        assert column.tobytes() == weak.columns[name].tobytes(), name


def test_truth_names_faults_and_how_severe_they_are(alpha):
    truth = run(
        alpha,
        Blockage(pump=2, start_s=100, end_s=500, after="clear"),
        SensorStuck(channel="head_m", pump=1, start_s=50, end_s=150, after="clear"),
        ImpellerWear(pump=2, start_s=300, end_s=400),
        AirPocket(start_s=600, end_s=700, shape="step", after="clear"),
        Blockage(pump=3, start_s=800, end_s=900),
        seconds=1000,
    ).truth

    def at(name):
        return [str(truth[name][second]) for second in (0, 50, 120, 200, 350, 550, 650, 850)]

    assert at("truth_fault") == [
        "",
        "sensor_stuck",
        "blockage+sensor_stuck",
        "blockage",
        "blockage+impeller_wear",
        "impeller_wear",
        "impeller_wear+air_pocket",
        "blockage+impeller_wear",
    ]
    pump, both = "pump_fault", "pump_and_system_fault"
    assert at("truth_state") == ["normal", "sensor_fault", pump, pump, pump, pump, both, pump]
    assert at("truth_pump1_state") == ["normal", *["sensor_fault"] * 2, *["normal"] * 3, "system_fault", "normal"]
    assert at("truth_pump2_state") == ["normal", "normal", pump, pump, pump, pump, both, pump]
    assert truth["truth_pump2_severity"][[0, 50, 200, 300, 350, 380, 450, 999]] == pytest.approx(
        [0, 0, 0.25, 0.5, 0.625, 0.8, 1, 1]
    )
    seconds = np.arange(1000)
    assert (truth["truth_pump1_severity"] == ((seconds >= 50) & (seconds <= 150))).all()
    assert truth["truth_pump3_severity"][850] == 0.5
    assert truth["truth_severity"][[0, 49, 50, 200, 650]] == pytest.approx([0, 0, 1, 0.25, 1])


def test_without_faults_truth_is_normal(alpha):
    truth = run(alpha, seconds=10).truth
    assert set(truth["truth_fault"]) == {""}
    assert set(truth["truth_state"]) | set(truth["truth_pump1_state"]) == {"normal"}
    assert not truth["truth_severity"].any()
    assert not truth["truth_pump3_severity"].any()
