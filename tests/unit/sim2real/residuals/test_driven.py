"""Which readings of a head are of a pump that does work."""

import numpy as np
import pytest

from wetwell.sim2real.recording.regimes import STEADY, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.driven import does_work
from wetwell.sim2real.residuals.signals import pump_residuals
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

INERTIA = EFFECTS["water_inertia"](inertia_s2_m2=3_000.0)


@pytest.fixture(scope="module")
def long_main(alpha):
    """Station whose water keeps moving for seconds after a stop."""
    return alpha.model_copy(update={"effect": (INERTIA,)})


def recorded(station, plain, factor=1.0):
    traces = traces_of(Simulation(station, Scenario(name="plain"), 7, 0).advance(14_400, truth=False), plain)
    traces.signals["flow_m3h"] *= factor
    return traces


@pytest.mark.parametrize("factor", [0.6, 1.0, 1.8])
def test_water_that_keeps_moving_drives_a_pump_that_is_slow_whatever_the_gain_of_its_meter(long_main, alpha, factor):
    traces = recorded(long_main, alpha, factor)
    truth = Replay(traces, alpha, (INERTIA,)).run()
    regimes = regimes_of(traces, alpha)
    works = does_work(traces, regimes, Replay(traces, alpha).run())
    (c0, c1, c2), flow_m3h = truth.plant.curves[0], truth.signals["flow_m3h"]
    ratio = traces.frequency_hz / truth.plant.nominal_frequency_hz[:, None]
    is_driven = (ratio > 0.0) & (c0 * ratio**2 + c1 * ratio * flow_m3h + c2 * flow_m3h**2 < -0.5)
    assert is_driven.sum() > 30
    assert not works[is_driven].any()
    assert not works[traces.frequency_hz == 0.0].any()
    assert works[regimes.of_pumps == STEADY].all()


def test_a_head_counts_only_while_its_pump_works_and_a_flow_always(long_main, alpha):
    traces = recorded(long_main, alpha)
    replay, regimes = Replay(traces, alpha), regimes_of(traces, alpha)
    plain = replay.run()
    works = does_work(traces, regimes, plain)
    found = pump_residuals(traces, alpha, regimes, plain, replay.doubt(is_level_held=False), {})
    for one in found:
        compared = works[one.pump, one.seconds.second]
        assert compared.all() == (one.name == "head_m")


def test_without_a_flow_meter_each_pump_that_turns_works(alpha):
    traces = recorded(alpha, alpha)
    del traces.signals["flow_m3h"]
    works = does_work(traces, regimes_of(traces, alpha), Replay(traces, alpha).run())
    np.testing.assert_array_equal(works, traces.frequency_hz > 0.0)
