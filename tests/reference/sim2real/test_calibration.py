"""Calibration on simulated stations that differ from the file: truth inside the intervals, and honest silence."""

import re

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_scenario
from wetwell.sim2real.calibration.calibration import calibrate
from wetwell.sim2real.calibration.estimates import Estimate
from wetwell.sim2real.calibration.fitted_station import possible_estimates, with_estimates
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
    ("name", "truth", "widest"),
    [
        ("pump[1].duty_head_m", None, 0.002),
        ("pump[3].duty_head_m", None, 0.002),
        ("rising_main.duty_head_m", None, 0.002),
        ("rising_main.friction_h2_m5", 7.1e-4, 0.09),
        ("sump.area_m2", 9.3, 0.04),
        ("control.start_levels_m[1]", 1.5, 0.04),
        ("control.stop_levels_m[1]", 0.5, 0.04),
    ],
)
def test_intervals_hold_the_truth_and_are_not_idle(fits, real, name, truth, widest):
    """Of 12 intervals of 95 % at least 9 hold the truth (fewer comes by chance once in 500), and they are narrow.

    Friction is as sure as the static head that the file gives, ±0.5 m of 25 m of friction head.
    """
    truths = [duty_head_m(real, fit[name]) if truth is None else truth for fit in fits]
    pairs = [(fit[name], true) for fit, true in zip(fits, truths, strict=True)]
    assert sum(one.interval[0] <= true <= one.interval[1] for one, true in pairs) >= 9
    assert max((one.interval[1] - one.interval[0]) / true for one, true in pairs) < widest
    assert abs(np.mean([one.value / true for one, true in pairs]) - 1.0) < 0.005


def duty_head_m(real, estimate):
    """True head at the flow that an estimate of a duty names."""
    flow_m3h = float(re.search(r"at ([0-9.]+) m³/h", estimate.reason)[1])
    if estimate.name.startswith("rising_main"):
        return 2.0 + 7.1e-4 * flow_m3h**2
    c0, c1, c2 = real.pump[0].coefficients
    return c0 + c1 * flow_m3h + c2 * flow_m3h**2


@pytest.mark.parametrize("name", ["pump[1].head_scale", "pump[2].flow_scale"])
def test_scales_of_a_curve_seen_at_one_duty_are_told_with_wide_intervals_around_the_truth(fits, name):
    for fit in fits:
        low, high = fit[name].interval
        assert low < 1.0 < high
        assert 0.1 < high - low < 3.92 * fit[name].prior[1]


def test_the_ramp_is_exact(fits):
    assert {round(fit["control.ramp_s"].value, 6) for fit in fits} == {8.0}


@pytest.mark.parametrize("name", ["rising_main.static_head_m", "pump[1].power_scale", "control.start_levels_m[2]"])
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
    assert fitted.pump[0].coefficients == pytest.approx(real.pump[0].coefficients, rel=0.01)
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


def test_levels_that_contradict_each_other_are_kept_and_explained(alpha):
    """Means of 15 min of a station with cycles of minutes: what they say of levels would be no station."""
    estimates = [
        Estimate(
            name="control.start_levels_m[1]",
            unit="m",
            value=0.4,
            place=("control", "start_levels_m", 0),
            interval=(0.3, 0.5),
        ),
        Estimate(name="sump.area_m2", unit="m²", value=9.0, place=("sump", "area_m2"), interval=(8.9, 9.1)),
    ]
    with pytest.raises(ValueError, match="must lie under start_levels_m"):
        with_estimates(alpha, estimates)
    level, area = possible_estimates(alpha, estimates)
    assert level.interval is None
    assert level.value == alpha.control.start_levels_m[0]
    assert level.reason.startswith("0.4 seen, but")
    assert area == estimates[1]


@pytest.mark.parametrize(("every", "value"), [(10, "instant"), (60, "mean"), (900, "mean")])
def test_thinned_recordings_of_a_level_driven_station_are_calibrated_as_far_as_they_show(alpha, real, every, value):
    full = Simulation(real, find_scenario("nominal"), 1).advance(2 * 86_400)
    if value == "mean":
        rows = slice(every - 1, None, every)
        columns = {name: values.reshape(-1, every).mean(axis=1) for name, values in full.columns.items()}
    else:
        rows = slice(None, None, every)
        columns = {name: values[rows] for name, values in full.columns.items()}
    thin = Recording(time_ns=full.time_ns[rows], columns=columns, value=value)
    fit = {one.name: one for one in calibrate(thin, alpha)}
    with_estimates(alpha, fit.values())
    assert "does not show a ramp" in fit["control.ramp_s"].reason
    if every == 10:
        assert fit["sump.area_m2"].value == pytest.approx(9.3, rel=0.05)
        assert fit["control.start_levels_m[1]"].value == pytest.approx(1.5, abs=0.02)
    if every < 900:
        low, high = fit["rising_main.friction_h2_m5"].interval
        assert low <= 7.1e-4 <= high
        assert fit["rising_main.friction_h2_m5"].value == pytest.approx(7.1e-4, rel=0.02)
    else:
        assert "are needed" in fit["rising_main.friction_h2_m5"].reason
