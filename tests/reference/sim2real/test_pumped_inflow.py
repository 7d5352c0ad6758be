"""An inflow that jumps, as behind another pump station, and that nobody measures is no gap."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import LEVEL, Bins
from wetwell.sim2real.residuals.pumped_inflow import alike_in_cycles
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SECONDS = 86_400


def pulses(rng, high_m3h, low_m3h):
    """Runs of some five minutes of a pump upstream, with rests of some ten."""
    lasting_s = rng.uniform(0.5, 1.5, 2 * SECONDS // 600) * np.tile([300.0, 600.0], SECONDS // 600)
    flow_m3h = np.tile([high_m3h, low_m3h], SECONDS // 600)
    return RecordedInflow(time_s=np.r_[0.0, np.cumsum(lasting_s)[:-1]], flow_m3h=flow_m3h)


def recorded(alpha, inflow, seed):
    """The station as its file says, without a meter of the inflow."""
    recording = Simulation(alpha, Scenario(name="pulses", inflow=inflow), seed).advance(SECONDS, truth=False)
    columns = {name: values for name, values in recording.columns.items() if "inflow" not in name}
    return replace(recording, columns=columns)


def alike(recording, alpha):
    traces = traces_of(recording, alpha)
    replay = Replay(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes_of(traces, alpha), replay.run(), replay.doubt())
    rows = residuals.bins.signal == LEVEL
    of_level = Bins(**{name: getattr(residuals.bins, name)[rows] for name in Bins.__dataclass_fields__})
    return alike_in_cycles(of_level, residuals.of(replay.run())[rows])


@pytest.mark.parametrize("seed", [971_101, 971_102])
def test_a_station_behind_another_one_is_as_its_file_says(alpha, seed):
    recording = recorded(alpha, pulses(np.random.default_rng(seed), 150.0, 5.0), seed)
    assert diagnose(recording, alpha, only=["friction_bias", "sump_area_profile"]).verdict == "none"


def test_errors_of_an_inflow_that_wanders_are_not_alike(alpha):
    even = RecordedInflow(time_s=[0.0], flow_m3h=[120.0])
    steady = alike(recorded(alpha, even, 971_103), alpha)
    jumping = alike(recorded(alpha, pulses(np.random.default_rng(971_101), 150.0, 5.0), 971_101), alpha)
    assert steady < 0.05 < jumping
