"""What was before a recording nobody knows: first runs of its pumps tell of that."""

import numpy as np
import pytest

from wetwell.protocols.orders import Step
from wetwell.sim2real.recording.joining import joined
from wetwell.sim2real.recording.regimes import FEWEST_CYCLES, IDLE, first_runs, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOUR_NS = 3600 * 10**9
STEPS = (Step(longest_s=900, speed_ratio=(0.8, 0.0, 0.0)),)


def recorded(station, start_ns, seconds, steps=()):
    recording = Simulation(station, Scenario(name="plain"), 3, start_ns, steps).advance(seconds, truth=False)
    return traces_of(recording, station, least_starts=1)


def ends(flags):
    return np.flatnonzero(flags[:-1] & ~flags[1:]) + 1


@pytest.fixture(scope="module")
def day(alpha):
    return recorded(alpha, 0, 28_800)


def test_each_pump_has_yet_to_end_its_first_run_until_it_stands_again(alpha, day):
    regimes = regimes_of(day, alpha)
    found = first_runs(day, regimes)
    for is_first, of_pump in zip(found, regimes.of_pumps, strict=True):
        until = ends(of_pump != IDLE)[0]
        assert is_first[:until].all()
        assert not is_first[until:].any()


def test_a_pump_that_hardly_ever_runs_counts_from_the_beginning(alpha):
    short = recorded(alpha, 0, 7_200)
    regimes = regimes_of(short, alpha)
    runs = np.array([ends(one != IDLE).size for one in regimes.of_pumps])
    assert runs.min() < FEWEST_CYCLES
    assert first_runs(short, regimes).any(axis=1).tolist() == (runs >= FEWEST_CYCLES).tolist()


def test_it_is_so_in_each_recording_that_was_left_alone_and_in_no_act(alpha, day):
    act = recorded(alpha, 24 * HOUR_NS, 3_600, STEPS)
    together = joined([day, act, recorded(alpha, 48 * HOUR_NS, 28_800)])
    found = first_runs(together, regimes_of(together, alpha))
    assert [bool(found[:, together.part == part].any()) for part in range(3)] == [True, False, True]
