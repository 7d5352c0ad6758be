"""Calibration on simulated stations that differ from the file: truth inside the intervals, and honest silence."""

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_scenario
from wetwell.sim2real.calibration.calibration import calibrate
from wetwell.sim2real.calibration.fitted_station import with_estimates
from wetwell.simulator.simulation import Simulation

SEEDS = range(12)


def changed(station: Station, **tables: dict[str, object]) -> Station:
    tree = station.model_dump(exclude_none=True)
    for table, values in tables.items():
        tree[table] |= values
    return Station.model_validate(tree)


@pytest.fixture(scope="module")
def real(alpha):
    """The station as it is; the file says `alpha`."""
    return changed(
        alpha,
        sump={"area_m2": 9.3},
        rising_main={"friction_h2_m5": 7.1e-4},
        control={"start_levels_m": [1.5, 1.8, 2.0], "ramp_s": 8.0},
    )


@pytest.fixture(scope="module")
def fits(alpha, real):
    scenario = find_scenario("nominal")
    return [
        {e.name: e for e in calibrate(Simulation(real, scenario, seed).advance(86_400), alpha, seed=seed)}
        for seed in SEEDS
    ]


@pytest.mark.parametrize(
    ("name", "truth"),
    [
        ("pump[1].c0", 36.0),
        ("pump[3].c0", 36.0),
        ("rising_main.friction_h2_m5", 7.1e-4),
        ("sump.area_m2", 9.3),
        ("control.start_levels_m[1]", 1.5),
        ("control.stop_levels_m[1]", 0.5),
    ],
)
def test_intervals_hold_the_truth_and_are_not_idle(fits, name, truth):
    """Of 12 intervals of 95 % at least 9 hold the truth (fewer comes by chance once in 500), and they are narrow."""
    inside = [fit[name].interval[0] <= truth <= fit[name].interval[1] for fit in fits]
    assert sum(inside) >= 9
    widths = [(fit[name].interval[1] - fit[name].interval[0]) / truth for fit in fits]
    assert max(widths) < 0.04
    assert abs(np.mean([fit[name].value for fit in fits]) / truth - 1.0) < 0.005


def test_the_ramp_is_exact(fits):
    assert {round(fit["control.ramp_s"].value, 6) for fit in fits} == {8.0}


@pytest.mark.parametrize(
    "name", ["rising_main.static_head_m", "pump[1].c1", "pump[2].c2", "control.start_levels_m[2]"]
)
def test_what_one_operating_point_cannot_tell_is_kept_and_explained(fits, alpha, name):
    for fit in fits:
        assert fit[name].interval is None
        assert fit[name].reason
    kept = fits[0]["rising_main.static_head_m"]
    assert kept.value == alpha.rising_main.static_head_m
    assert "cannot be told apart" in kept.reason


def test_two_pumps_on_a_common_header_separate_static_head_from_friction(alpha):
    file = changed(alpha, rising_main={"layout": "common", "friction_h2_m5": 2.0e-4})
    real = changed(alpha, rising_main={"layout": "common", "friction_h2_m5": 2.6e-4, "static_head_m": 4.0})
    wet = find_scenario("clogging").model_copy(update={"fault": ()})
    surges = wet.inflow.surges.model_copy(update={"flow_m3h": 150.0})
    wet = wet.model_copy(update={"inflow": wet.inflow.model_copy(update={"surges": surges})})
    fit = {e.name: e for e in calibrate(Simulation(real, wet, 3).advance(2 * 86_400), file)}
    for name, truth in (("rising_main.static_head_m", 4.0), ("rising_main.friction_h2_m5", 2.6e-4)):
        assert fit[name].interval is not None, fit[name].reason
        assert fit[name].interval[0] <= truth <= fit[name].interval[1]


def test_the_fitted_station_is_one(fits, alpha, real):
    fitted = with_estimates(alpha, tuple(fits[0].values()))
    assert fitted.sump.area_m2 == pytest.approx(real.sump.area_m2, rel=0.02)
    assert fitted.rising_main.friction_h2_m5 == pytest.approx(real.rising_main.friction_h2_m5, rel=0.01)
    assert fitted.control.start_levels_m[0] == pytest.approx(1.5, abs=0.01)
    assert fitted.name == alpha.name


def test_an_empty_recording_keeps_everything(alpha):
    idle = Recording(
        time_ns=np.arange(100) * 10**9,
        columns={name: np.zeros(100) for name in ("level_m", "pump1_frequency_hz", "pump1_flow_m3h", "pump1_head_m")},
    )
    estimates = calibrate(idle, alpha)
    assert all(estimate.interval is None and estimate.reason for estimate in estimates)
    assert with_estimates(alpha, estimates) == alpha
