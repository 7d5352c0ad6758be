"""Effects whose strength differs between recordings."""

from types import SimpleNamespace

import numpy as np
import pytest

from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.attribution.search import in_order
from wetwell.sim2real.likelihood.posterior import SetProbability
from wetwell.sim2real.recording.joining import joined
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.changing import Changing
from wetwell.sim2real.replay.replay import Replay
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation


@pytest.fixture(scope="module")
def replay(alpha):
    parts = [
        traces_of(Simulation(alpha, Scenario(name="plain"), k, k * 10**14).advance(7200), alpha, least_starts=1)
        for k in range(2)
    ]
    return Replay(joined(parts), alpha)


def friction(factor):
    return EFFECTS["friction_bias"](factor=factor)


def test_each_period_has_its_own_strength(replay):
    first, second = (replay.run([friction(factor)]) for factor in (1.1, 1.4))
    both = replay.run([Changing(periods=(friction(1.1), friction(1.4)))])
    is_second = replay.period == 1
    for name, values in both.signals.items():
        assert np.array_equal(values[:, ~is_second], first.signals[name][:, ~is_second])
        assert np.array_equal(values[:, is_second], second.signals[name][:, is_second])
    assert np.array_equal(both.level_m, np.where(is_second, second.level_m, first.level_m))
    assert both.plant.mains == second.plant.mains


def test_a_strength_is_free_in_each_period_and_the_rest_is_shared(alpha):
    ragging = next(one for one in candidates_of(len(alpha.pump), 1, only=["ragging"]) if dict(one.fixed)["pump"] == 0)
    changing = ragging.changing(2)
    names = [free.name for free in changing.free]
    strengths = [free.name for free in ragging.free if free.neutral is not None]
    shared = [free.name for free in ragging.free if free.neutral is None]
    assert strengths
    assert sorted(names) == sorted([*(f"{name}@{k}" for name in strengths for k in (1, 2)), *shared])
    point = np.linspace(0.2, 0.8, len(names))
    acting = changing.acting(point)
    assert [one.name for one in acting.periods] == ["ragging", "ragging"]
    assert acting.periods[0] != acting.periods[1] == changing.effect(point)


@pytest.mark.parametrize(
    ("shares", "order"),
    [
        ({("friction_bias", "head_sensor_offset"): 1.0}, ["head_sensor_offset", "friction_bias"]),
        (
            {("friction_bias", "head_sensor_offset"): 0.6, ("friction_bias", "pump_wear"): 0.4},
            ["friction_bias", "head_sensor_offset"],
        ),
    ],
    ids=["the one that leaves most", "the surer one"],
)
def test_what_surely_acts_is_told_first_and_what_is_not_told_comes_last(shares, order):
    names = ("water_inertia", "friction_bias", "head_sensor_offset")
    left = {"water_inertia": 9.0, "friction_bias": 2.0, "head_sensor_offset": 5.0}
    candidates = tuple(
        next(one for one in candidates_of(1, 1, only=[name]) if all(value == 0 for _, value in one.fixed))
        for name in names
    )
    points = tuple(np.zeros(len(one.free)) for one in candidates)
    fit = Fit(candidates=candidates, points=points, residuals=np.zeros(1))
    fitter = SimpleNamespace(without=lambda _, member: names[member], cost=left.__getitem__)
    ends = np.concatenate([np.full((len(one.free), 2), float(number)) for number, one in enumerate(candidates)])
    posterior = [SetProbability(effects=one, verdict="effect", probability=p) for one, p in shares.items()]
    ordered, its_ends = in_order(fitter, fit, ends, order, posterior)
    assert list(ordered.names) == [*order, "water_inertia"]
    numbers = [float(names.index(name)) for name in ordered.names]
    assert [part[0, 0] for part in ordered.split(its_ends)] == numbers
