"""Where the search for a delay begins."""

import numpy as np
import pytest

from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.initial_guess import initial_guesses
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation


def guessed_s(station, effects, channel):
    """Delay from which the search begins, for a recording under some effects."""
    acting = station.model_copy(update={"effect": effects})
    traces = traces_of(Simulation(acting, Scenario(name="plain"), 7, 0).advance(14_400, truth=False), station)
    replay = Replay(traces, station)
    residuals = StationResiduals(traces, station, regimes_of(traces, station), replay.run(), replay.doubt)
    candidates = {dict(one.fixed)["channel"]: one for one in candidates_of(3, 1, only=["channel_delay"])}
    plain = residuals.of(replay.run())
    return [one.get("delay_s") for one in initial_guesses(candidates[channel], replay, residuals, plain)]


@pytest.mark.parametrize("channel", ["flow_m3h", "head_m", "frequency_hz"])
@pytest.mark.parametrize("delay_s", [3.0, 12.6, 40.0])
def test_it_begins_within_a_second_of_the_delay_whatever_acts_beside_it(alpha, channel, delay_s):
    others = (EFFECTS["common_header"](shared_fraction=0.6), EFFECTS["motor_slip"](slip=0.05))
    delay = EFFECTS["channel_delay"](channel=channel, delay_s=delay_s)
    for effects in ((delay,), (delay, *others)):
        assert guessed_s(alpha, effects, channel) == [pytest.approx(delay_s, abs=1.0)]


def test_a_signal_that_is_not_late_has_no_guess(alpha):
    assert guessed_s(alpha, (), "head_m") == [None]
    assert np.all([one is None for one in guessed_s(alpha, (), "level_m")])
