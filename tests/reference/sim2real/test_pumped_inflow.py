"""An inflow that jumps, as behind another pump station, and that nobody measures is no gap."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.sim2real.attribution.attribution import weighed_cells
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.likelihood.cells import Jumps
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import LEVEL
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


def learnt(recording, alpha) -> Jumps | None:
    traces = traces_of(recording, alpha)
    replay = Replay(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes_of(traces, alpha), replay.run(), replay.doubt)
    found = weighed_cells(replay, residuals, residuals.of(replay.run()))
    return next(block.jumps for block in found.blocks if block.signal == LEVEL and block.may_jump)


@pytest.mark.parametrize(
    ("seed", "high_m3h", "low_m3h"),
    [
        *(pytest.param(seed, 150.0, 5.0, marks=pytest.mark.long) for seed in (971_101, 971_102)),
        (971_103, 94.0, 4.0),
        pytest.param(971_105, 220.0, 30.0, marks=pytest.mark.long),
    ],
)
def test_a_station_behind_another_one_is_as_its_file_says(alpha, seed, high_m3h, low_m3h):
    recording = recorded(alpha, pulses(np.random.default_rng(seed), high_m3h, low_m3h), seed)
    assert diagnose(recording, alpha).verdict == "none"


def test_jumps_are_learnt_from_the_level_at_rest(alpha):
    even = RecordedInflow(time_s=[0.0], flow_m3h=[120.0])
    assert learnt(recorded(alpha, even, 971_103), alpha) is None
    jumps = learnt(recorded(alpha, pulses(np.random.default_rng(971_101), 150.0, 5.0), 971_101), alpha)
    assert jumps is not None
    assert 0.05 < jumps.probability < 0.2
    assert 10.0 * jumps.quiet < 1.0 < 0.1 * jumps.jumping


def test_a_rounded_level_says_nothing_of_jumps(alpha):
    recording = recorded(alpha, pulses(np.random.default_rng(971_101), 150.0, 5.0), 971_101)
    level_m = np.round(recording.columns["level_m"] / 0.07) * 0.07
    assert learnt(replace(recording, columns=recording.columns | {"level_m": level_m}), alpha) is None
