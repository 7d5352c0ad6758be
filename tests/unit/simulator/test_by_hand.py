"""What an operator does at the simulated station."""

import numpy as np
import pytest

from wetwell.protocols.orders import Step
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.inflow.surges import Surges
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

QUIET = DiurnalInflow(mean_m3h=60.0, amplitude_m3h=0.0, noise_m3h=0.0, surges=Surges(flow_m3h=0.0))
STEPS = (
    Step(longest_s=1800, speed_ratio=(0.0, 0.0, 0.0), high_m=1.5),
    Step(longest_s=120, speed_ratio=(0.85, 0.0, 0.0)),
    Step(longest_s=60, speed_ratio=(0.85, 0.0, 0.0), is_valve_shut=True),
    Step(longest_s=60, speed_ratio=(0.0, 0.0, 0.9), is_inlet_shut=True),
)


def simulation(station, steps=STEPS):
    return Simulation(station, Scenario(name="act", inflow=QUIET), 1, steps=steps)


@pytest.fixture(scope="module")
def played(alpha):
    return simulation(alpha).advance(3600)


def test_pumps_run_as_they_are_told_and_then_as_the_controller_wants(alpha, played):
    by_hand = played.column("by_hand") > 0.0
    ended = int(np.flatnonzero(by_hand)[-1])
    assert set(np.round(played.column("pump1_frequency_hz")[:ended], 6).tolist()) >= {0.0, 42.5}
    assert played.column("pump1_frequency_hz")[:ended].max() == pytest.approx(42.5)
    assert not played.column("pump2_frequency_hz")[:ended].any()
    assert played.column("pump3_frequency_hz")[ended] == pytest.approx(45.0)
    assert played.column("pump3_frequency_hz")[ended + 10] == pytest.approx(50.0)  # it runs on, as the level is high
    stop = ended + 10 + int(np.flatnonzero(played.column("pump3_frequency_hz")[ended + 10 :] < 49.9)[0])
    assert played.column("level_m")[stop - 1] == pytest.approx(alpha.control.stop_levels_m[0], abs=0.03)


def test_against_a_shut_valve_hardly_anything_flows_and_the_head_is_that_of_no_flow(alpha, played):
    shut = np.flatnonzero(played.column("valve_open") == 0.0)
    assert shut.size == 60
    c0 = alpha.pump[0].curve[0]
    assert played.truth["truth_pump1_flow_m3h"][shut].max() < 1.0
    assert played.truth["truth_pump1_head_m"][shut] == pytest.approx(np.full(60, c0 * 0.85**2), rel=0.01)


def test_nothing_comes_in_by_a_shut_inlet(played):
    is_shut = played.column("inlet_open") == 0.0
    assert is_shut.sum() == 60
    assert not played.truth["truth_inflow_m3h"][is_shut].any()
    assert (played.truth["truth_inflow_m3h"][~is_shut] == 60.0).all()


def test_blocks_make_no_difference(alpha, played):
    one = simulation(alpha)
    parts = [one.advance(seconds) for seconds in (200, 77, 1, 522, 2800)]
    for name, values in played.columns.items():
        assert np.array_equal(np.concatenate([part.columns[name] for part in parts]), values), name


def test_a_station_that_is_left_alone_has_no_columns_of_a_crew(alpha):
    left = simulation(alpha, ()).advance(60)
    assert not {"by_hand", "valve_open", "inlet_open"} & left.columns.keys()


def test_a_step_for_another_station_is_refused(alpha):
    with pytest.raises(ValueError, match="got 2 speeds, the station has 3 pumps"):
        simulation(alpha, [Step(longest_s=1.0, speed_ratio=(0.0, 0.0))])
