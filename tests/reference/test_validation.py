"""Free-running comparison of a simulator with a recording."""

import numpy as np
import pytest

from wetwell.protocols.recording import Recording
from wetwell.services.presets import find_scenario
from wetwell.sim2real.validation import validate
from wetwell.simulator.simulation import Simulation

DAY_S = 86_400


@pytest.fixture(scope="module")
def recording(alpha):
    return Simulation(alpha, find_scenario("clogging"), 5).advance(DAY_S, truth=False)


def test_the_right_station_under_the_measured_inflow_agrees_in_starts_and_run_time(alpha, recording):
    result, simulated = validate(recording, alpha)
    assert result.inflow == "measured"
    assert result.days == ("2025-01-01",)
    assert np.abs(result.starts[0] - result.starts[1]).max() <= 1
    assert np.abs(result.run_h[0] - result.run_h[1]).max() < 0.1
    assert result.level_nmae < 0.1
    assert len(simulated) == len(recording)
    assert result.starts[0].sum() > 60


def test_without_a_measured_inflow_it_is_inferred(alpha, recording):
    kept = {name: values for name, values in recording.columns.items() if name != "inflow_m3h"}
    result, _ = validate(Recording(time_ns=recording.time_ns, columns=kept), alpha)
    assert result.inflow == "inferred"
    assert np.abs(result.starts[0] - result.starts[1]).max() <= 2


def test_a_wrong_station_shows(alpha, recording):
    wrong = alpha.model_copy(update={"sump": alpha.sump.model_copy(update={"area_m2": 16.0})})
    result, _ = validate(recording, wrong)
    assert result.starts[1].sum() < 0.7 * result.starts[0].sum()


def test_what_cannot_be_compared_is_said(alpha, recording):
    kept = {name: values for name, values in recording.columns.items() if name != "level_m"}
    blind = Recording(time_ns=recording.time_ns, columns=kept)
    with pytest.raises(ValueError, match="'level_m' has no values"):
        validate(blind, alpha)
    single = alpha.model_copy(update={"pump": alpha.pump[:1]})
    with pytest.raises(ValueError, match="the recording has 3 pumps, station 'alpha' 1"):
        validate(recording, single)
