"""Shape of the faults over time, what they do to the operating point, and what the truth columns say of them."""

import math
from typing import Literal

import numpy as np
import pytest

from wetwell.protocols.stamps import NS_PER_S
from wetwell.simulator.faults.blockage import Blockage
from wetwell.simulator.faults.pipe_clogging import PipeClogging
from wetwell.simulator.faults.profile import Ramp
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.plant import healthy_forcing
from wetwell.simulator.scenario import DEFAULT_START_NS, Scenario
from wetwell.simulator.simulation import Simulation

STATIC_M, FRICTION = 2.0, 6e-4
C0, C1, C2 = 36.0, -0.02333, -1.3333e-4


def run(station, *faults, seconds=3000, inflow_m3h=900.0, layout: Literal["individual", "common"] = "individual"):
    """A station under an inflow that keeps all pumps on."""
    main = station.rising_main.model_copy(update={"layout": layout})
    flood = RecordedInflow(time_s=[0.0], flow_m3h=[inflow_m3h])
    scenario = Scenario(name="flood", initial_level_m=3.0, inflow=flood, fault=faults)
    return Simulation(station.model_copy(update={"rising_main": main}), scenario, seed=1).advance(seconds)


def at_full_frequency(recording, pump, from_s):
    """Flow and head of a pump while the drive gives 50 Hz, from some second on."""
    full = recording.columns[f"pump{pump}_frequency_hz"] == 50
    full[:from_s] = False
    assert full.sum() > 100
    return recording.columns[f"pump{pump}_flow_m3h"][full], recording.columns[f"pump{pump}_head_m"][full]


@pytest.mark.parametrize("after", ["hold", "clear"])
def test_ramp_rises_linearly_then_holds_or_clears(after):
    ramp = Ramp(start_s=100, end_s=300, after=after)
    time_s = np.array([0.0, 99.0, 100.0, 101.0, 150.0, 200.0, 299.0, 300.0, 300.5, 301.0, 1e6])
    last = 1.0 if after == "hold" else 0.0
    expected = [0, 0, 0, 0.005, 0.25, 0.5, 0.995, 1, last, last, last]
    assert ramp.share(time_s) == pytest.approx(expected, abs=1e-15)
    active = [False, False, True, True, True, True, True, True, *[after == "hold"] * 3]
    assert ramp.is_active(time_s).tolist() == active


def test_blockage_takes_speed_from_its_own_pump_only():
    forcing = healthy_forcing(np.zeros(4), pumps=3)
    Blockage(pump=2, start_s=0, end_s=2, speed_loss=0.4).apply(forcing, np.arange(4.0))
    assert forcing.speed_factor[1] == pytest.approx([1.0, 0.8, 0.6, 0.6])
    assert (forcing.speed_factor[[0, 2]] == 1).all()
    assert (forcing.friction_factor == 1).all()
    assert (forcing.static_rise_m == 0).all()


def test_clogging_raises_friction_and_static_head():
    forcing = healthy_forcing(np.zeros(4), pumps=3)
    PipeClogging(start_s=0, end_s=2, friction_rise=1.0, static_rise_m=0.5).apply(forcing, np.arange(4.0))
    assert forcing.friction_factor == pytest.approx([1.0, 1.5, 2.0, 2.0])
    assert forcing.static_rise_m == pytest.approx([0.0, 0.25, 0.5, 0.5])
    assert (forcing.speed_factor == 1).all()


def test_faults_at_the_same_time_combine():
    forcing = healthy_forcing(np.zeros(2), pumps=1)
    for fault in (
        Blockage(pump=1, start_s=0, end_s=1, speed_loss=0.5),
        Blockage(pump=1, start_s=0, end_s=1, speed_loss=0.2),
        PipeClogging(start_s=0, end_s=1, friction_rise=1.0, static_rise_m=0.5),
        PipeClogging(start_s=0, end_s=1, friction_rise=0.5, static_rise_m=0.25),
    ):
        fault.apply(forcing, np.array([0.0, 1.0]))
    assert forcing.speed_factor[0] == pytest.approx([1.0, 0.4])
    assert forcing.friction_factor == pytest.approx([1.0, 3.0])
    assert forcing.static_rise_m == pytest.approx([0.0, 0.75])


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


def test_a_fault_of_a_pump_that_is_not_there_is_refused(alpha):
    faults = (Blockage(pump=3, start_s=0, end_s=1), Blockage(pump=4, start_s=0, end_s=1))
    rule = r"fault\[2\]\.pump: got 4, station 'alpha' has 3 pumps$"
    with pytest.raises(ValueError, match=rule):
        Simulation(alpha, Scenario(name="wrong", fault=faults), seed=1)
