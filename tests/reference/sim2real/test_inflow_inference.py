"""Inferred inflow against the true one of simulated stations."""

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording
from wetwell.sim2real.recording.inflow import infer_inflow_m3h, pumped_m3h
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

DAY_S = 86_400


def day(station, seed=1):
    """A day under an inflow that moves slowly: half-hour means of a sine."""
    time_s = np.arange(0.0, DAY_S, 1800.0)
    flow_m3h = 60.0 + 30.0 * np.sin(2.0 * np.pi * time_s / DAY_S)
    inflow = RecordedInflow(time_s=time_s, flow_m3h=flow_m3h)
    return Simulation(station, Scenario(name="slow", inflow=inflow), seed).advance(DAY_S)


def without(recording, *names):
    kept = {name: values for name, values in recording.columns.items() if name not in names}
    return Recording(time_ns=recording.time_ns, columns=kept)


@pytest.mark.parametrize("layout", ["individual", "common"])
@pytest.mark.parametrize("dropped", [(), ("pump1_flow_m3h", "pump2_flow_m3h", "pump3_flow_m3h")])
def test_the_inferred_inflow_is_the_true_one_but_for_noise(alpha, layout, dropped):
    station = alpha.model_copy(update={"rising_main": alpha.rising_main.model_copy(update={"layout": layout})})
    recording = day(station)
    inferred_m3h = infer_inflow_m3h(without(recording, "inflow_m3h", *dropped), station)
    error_m3h = inferred_m3h - recording.truth["truth_inflow_m3h"]
    known = np.isfinite(error_m3h)
    assert known.mean() > 0.95
    assert abs(np.median(error_m3h[known])) < 0.5
    # The line through 60 samples of 2 mm noise has a slope noise of .002 sqrt(12 / 60**3) m/s: .43 m³/h at 8 m².
    assert np.median(np.abs(error_m3h[known])) < 1.0


def test_a_profile_is_taken_into_account(quiet_alpha):
    sump = quiet_alpha.sump.model_copy(update={"profile": ((0.0, 3.0), (1.0, 12.0))})
    station = quiet_alpha.model_copy(update={"sump": sump})
    recording = day(station)
    error_m3h = infer_inflow_m3h(recording, station) - recording.truth["truth_inflow_m3h"]
    assert np.nanmedian(np.abs(error_m3h)) < 0.1
    plain = infer_inflow_m3h(recording, quiet_alpha) - recording.truth["truth_inflow_m3h"]
    assert np.nanmedian(np.abs(plain)) > 5.0, "the wrong profile must show"


def test_a_month_keeps_its_digits(quiet_alpha):
    """Running sums over 26 days of 1 s would lose the slopes in rounding."""
    recording = day(quiet_alpha)
    shifted = Recording(
        time_ns=np.concatenate([recording.time_ns[:10] - 26 * DAY_S * 10**9, recording.time_ns]),
        columns={name: np.concatenate([values[:10], values]) for name, values in recording.columns.items()},
    )
    plain_m3h = infer_inflow_m3h(recording, quiet_alpha)
    assert infer_inflow_m3h(shifted, quiet_alpha)[110:] == pytest.approx(plain_m3h[100:], abs=1e-3, nan_ok=True)


def test_flow_from_the_duty_point_and_from_the_meter_agree(quiet_alpha):
    recording = day(quiet_alpha)
    metered_m3h = pumped_m3h(recording, quiet_alpha)
    names = [f"pump{i}_flow_m3h" for i in (1, 2, 3)]
    computed_m3h = pumped_m3h(without(recording, *names), quiet_alpha)
    assert computed_m3h == pytest.approx(metered_m3h, abs=0.5)


def test_a_large_station_has_large_inflows(quiet_alpha):
    """Ten times the area and pumps of ten times the flow: ten times the inflow, none of it a spike."""
    pumps = [
        pump.model_copy(update={"curve": (c0, c1 / 10.0, c2 / 100.0)})
        for pump in quiet_alpha.pump
        for c0, c1, c2 in [pump.coefficients]
    ]
    main = quiet_alpha.rising_main.model_copy(
        update={"friction_h2_m5": quiet_alpha.rising_main.friction_h2_m5 / 100.0}
    )
    large = quiet_alpha.model_copy(
        update={
            "pump": tuple(pumps),
            "rising_main": main,
            "sump": quiet_alpha.sump.model_copy(update={"area_m2": 10.0 * quiet_alpha.sump.area_m2}),
        }
    )
    inflow = RecordedInflow(time_s=(0.0, 7200.0), flow_m3h=(1900.0, 1900.0))
    recording = Simulation(large, Scenario(name="rain", inflow=inflow), 1).advance(7200)
    inferred_m3h = infer_inflow_m3h(recording, large)
    assert np.isfinite(inferred_m3h).mean() > 0.9
    assert np.nanmedian(inferred_m3h) == pytest.approx(1900.0, rel=0.02)


def test_what_is_missing_is_said(alpha):
    recording = day(alpha)
    with pytest.raises(ValueError, match="'level_m' is missing"):
        infer_inflow_m3h(without(recording, "level_m"), alpha)
    backward = Recording(time_ns=recording.time_ns[::-1], columns=recording.columns)
    with pytest.raises(ValueError, match="times must rise"):
        infer_inflow_m3h(backward, alpha)
