"""Faults and effects of one rising main of several: the other main is as in health, bit for bit."""

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.services.stations import find_station
from wetwell.simulator.effects import effects_of
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOURS = 6
CLOGGED = {"kind": "pipe_clogging", "start_s": 0, "end_s": 600, "friction_rise": 1.5, "static_rise_m": 0.5}


@pytest.fixture(scope="module")
def twin():
    return find_station("twin")


def simulated(station, *faults):
    """Recording of a morning in which mostly one pump runs at a time."""
    scenario = Scenario.model_validate(
        {
            "name": "one-main",
            "fault": faults,
            "initial_level_m": -1.0,
            "inflow": {"kind": "diurnal", "mean_m3h": 120.0},
        }
    )
    return Simulation(station, scenario, 5).advance(HOURS * 3600)


def duty_m3h(recording, pump):
    """Median flow of a pump while it alone runs steadily."""
    running = np.array([recording.columns[f"pump{i}_frequency_hz"] for i in range(1, 5)]) >= 49.9
    alone = running[pump - 1] & (running.sum(axis=0) == 1)
    return np.median(recording.truth[f"truth_pump{pump}_flow_m3h"][alone])


def test_a_fault_of_one_main_lowers_the_flows_of_its_pumps_only(twin):
    healthy, faulty = simulated(twin), simulated(twin, CLOGGED | {"main": 2})
    for pump in (1, 3):
        assert duty_m3h(faulty, pump) == pytest.approx(duty_m3h(healthy, pump), rel=0.01)
    for pump in (2, 4):
        assert duty_m3h(faulty, pump) < 0.95 * duty_m3h(healthy, pump)
    assert [set(faulty.truth[f"truth_pump{i}_state"][700:]) for i in range(1, 5)] == 2 * [
        {"normal"},
        {"system_fault"},
    ]
    assert faulty.truth["truth_main2_friction_factor"][-1] == 2.5
    assert set(faulty.truth["truth_main1_friction_factor"]) == {1.0}


def test_a_fault_of_all_mains_is_that_of_each(twin):
    both, one_by_one = simulated(twin, CLOGGED), simulated(twin, CLOGGED | {"main": 1}, CLOGGED | {"main": 2})
    for name, values in both.columns.items():
        assert np.array_equal(values, one_by_one.columns[name], equal_nan=True)


@pytest.mark.parametrize(
    "effect",
    [
        {"name": "friction_bias", "factor": 2.0},
        {"name": "static_head_bias", "offset_m": 3.0},
        {"name": "air_pocket", "head_m": 4.0, "purge_s": 1e4},
        {"name": "level_dependent_static_head", "slope": 1.0, "reference_level_m": 5.0},
    ],
)
def test_an_effect_on_one_main_changes_the_flows_of_its_pumps_only(twin, effect):
    def with_effect(**table):
        return twin.model_copy(update={"effect": (EffectTable.model_validate(effect | table),)})

    healthy, on_one = simulated(twin), simulated(with_effect(main=1))
    for pump in (2, 4):
        assert duty_m3h(on_one, pump) == pytest.approx(duty_m3h(healthy, pump), rel=0.01)
    for pump in (1, 3):
        assert abs(duty_m3h(on_one, pump) / duty_m3h(healthy, pump) - 1.0) > 0.02


def test_a_main_that_is_not_there_is_refused_with_its_place(twin):
    station = twin.model_copy(
        update={"effect": (EffectTable.model_validate({"name": "friction_bias", "factor": 1.2, "main": 3}),)}
    )
    with pytest.raises(ValueError, match=r"^station 'twin': effect\[1\]\.main: got 3, there are 2 mains$"):
        effects_of(station)
    with pytest.raises(
        ValueError, match=r"^scenario 'one-main': fault\[1\]\.main: got 3, station 'twin' has 2 mains$"
    ):
        simulated(twin, CLOGGED | {"main": 3})
