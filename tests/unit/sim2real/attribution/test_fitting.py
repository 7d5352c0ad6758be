"""Fits of effects beside others that are fitted again."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fitting import Fitter
from wetwell.sim2real.attribution.promise import MOST_COLUMNS, MOST_SCALED, Alone, Beside
from wetwell.sim2real.recording.regimes import STEADY, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import residuals_of
from wetwell.sim2real.residuals.bins import FLOW, HEAD
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

TRUTH = (EFFECTS["flow_meter_lag"](lag_s=4.0), EFFECTS["water_inertia"](inertia_s2_m2=400.0))


def candidate(alpha, name):
    return next(one for one in candidates_of(len(alpha.pump), 1, only=[name]) if set(dict(one.fixed).values()) <= {0})


def fitter_of(alpha, truth):
    station = alpha.model_copy(
        update={"effect": tuple(EffectTable.model_validate(one.model_dump()) for one in truth)}
    )
    traces = traces_of(Simulation(station, Scenario(name="plain"), 5, 0).advance(14_400), alpha)
    regimes = regimes_of(traces, alpha)
    replay = Replay(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes, replay.run(), replay.doubt)
    return Fitter(replay, residuals, np.ones(residuals.bins.signal.size, dtype=np.bool_))


@pytest.fixture(scope="module")
def fitter(alpha):
    return fitter_of(alpha, TRUTH)


@pytest.fixture(scope="module")
def lag(fitter, alpha):
    """The lag of one filter alone, which has taken the place of the inertia as far as it can."""
    one = candidate(alpha, "flow_meter_lag")
    return fitter.refine(fitter.at([replace(one, free=one.free[:1])], [np.array([0.05])]))


def alone(fitter, candidate):
    fits = fitter.along(candidate, candidate.start_grids({}))
    plain = residuals_of(fitter.plain.residuals)
    return Alone(
        candidate=candidate,
        points=tuple(fit.points[0] for fit in fits),
        changes=np.array([residuals_of(fit.residuals) - plain for fit in fits]),
    )


class White:
    """All bins count alike, each by itself."""

    def products(self, columns):
        return columns.T @ columns


def squares(fit):
    return float(np.sum(residuals_of(fit.residuals) ** 2))


def beside(fitter, fit):
    return Beside(
        weights=White(), residuals=residuals_of(fit.residuals), slopes=fitter.slopes(fit), position=fit.position
    )


def best(its):
    """The best promise of the only candidate."""
    ((first, *_),) = its
    return first


def test_what_comes_beside_a_fit_lets_it_give_way(fitter, lag, alpha):
    promise = best(beside(fitter, lag).promises([alone(fitter, candidate(alpha, "water_inertia"))]))
    start = fitter.at((*lag.candidates, promise.candidate), (*lag.points, promise.point))
    assert fitter.cost(start) > fitter.cost(lag), "beside the lag as it stands nothing is gained"
    assert promise.gain > 0.1 * squares(lag)
    both = fitter.refine(start)
    assert squares(lag) - squares(both) > promise.gain, "the inertia shortens the lag, which a sum does not know"
    found = {effect.name: effect.model_dump() for effect in both.effects}
    assert found["flow_meter_lag"]["lag_s"] == pytest.approx(4.0, abs=0.2)
    assert found["water_inertia"]["inertia_s2_m2"] == pytest.approx(400.0, rel=0.2)


def test_a_limit_that_stands_wrong_is_put_right_though_another_effect_came_last(alpha):
    fitter = fitter_of(alpha, [EFFECTS["flow_meter_lag"](lag_s=4.0), EFFECTS["flow_low_cutoff"](cutoff_m3h=70.0)])
    limit, lag = candidate(alpha, "flow_low_cutoff"), candidate(alpha, "flow_meter_lag")
    lag = replace(lag, free=lag.free[:1])
    wrong, right = (np.array([limit.free[0].normalised(cutoff_m3h)]) for cutoff_m3h in (95.0, 70.0))
    found = fitter.refine(fitter.at([limit, lag], [wrong, np.array([0.05])]))
    assert fitter.cost(found) <= 1.01 * fitter.cost(fitter.refine(fitter.at([lag, limit], [np.array([0.05]), right])))


def test_a_fit_is_in_the_form_that_fits_best_wherever_it_began(fitter, alpha):
    """No slope leads from waves of three seconds to water that moves as one."""
    lag, inertia = candidate(alpha, "flow_meter_lag"), candidate(alpha, "water_inertia")
    lag = replace(lag, free=lag.free[:1])
    begun = [free.normalised(value) for free, value in zip(inertia.free, (350.0, 3.0), strict=True)]
    found = fitter.refine(fitter.at([lag, inertia], [np.array([0.1]), np.array(begun)]))
    values = {effect.name: effect.model_dump() for effect in found.effects}
    assert values["water_inertia"]["wave_s"] < 0.7
    assert values["water_inertia"]["inertia_s2_m2"] == pytest.approx(400.0, rel=0.1)


def test_each_form_of_an_effect_has_a_promise_of_its_own(fitter, lag, alpha):
    """What a wave does there and back is not linear in its time: each start of it is replayed."""
    inertia = candidate(alpha, "water_inertia")
    grids = [grid for wave_s in (0.0, 3.0) for grid in inertia.start_grids({"wave_s": wave_s})]
    plain = residuals_of(fitter.plain.residuals)
    fits = fitter.along(inertia, grids)
    one = Alone(
        candidate=inertia,
        points=tuple(fit.points[0] for fit in fits),
        changes=np.array([residuals_of(fit.residuals) - plain for fit in fits]),
    )
    (promises,) = beside(fitter, lag).promises([one])
    names = [free.name for free in inertia.free]
    waves = [inertia.free[names.index("wave_s")].value(float(its.point[names.index("wave_s")])) for its in promises]
    assert sorted(waves) == pytest.approx([0.0, 3.0])
    assert promises[0].gain >= promises[1].gain


def test_a_promise_of_what_is_linear_is_what_least_squares_find(alpha):
    """A known change and known slopes: strength and the other's move are those of lstsq."""
    rng = np.random.default_rng(7)
    slopes, change = rng.normal(size=(500, 1)), rng.normal(size=500)
    change += 0.2 * slopes[:, 0]
    wanted = rng.normal(size=500) - 1.4 * change
    wanted -= slopes[:, 0] * (slopes[:, 0] @ wanted) / (slopes[:, 0] @ slopes[:, 0])
    (lift,) = candidates_of(len(alpha.pump), 1, only=["static_head_bias"])
    point = np.array([lift.free[0].normalised(1.0)])
    one = Alone(candidate=lift, points=(point,), changes=change[None, :])
    promise = best(Beside(weights=White(), residuals=wanted, slopes=slopes, position=np.array([0.5])).promises([one]))
    (scale, _), left, _, _ = np.linalg.lstsq(np.column_stack([change, slopes]), -wanted, rcond=None)
    assert lift.free[0].value(promise.point[0]) == pytest.approx(scale, rel=1e-4)
    assert promise.gain == pytest.approx(float(wanted @ wanted - left[0]), rel=1e-4)


def test_a_pattern_promises_what_it_does_as_strong_as_the_values_show_it():
    """However much more of it would explain."""
    wanted, change = np.full(9, -3.0), np.ones(9)
    gains = {}
    for name in ("level_quantisation", "static_head_bias"):
        (one,) = candidates_of(1, 1, only=[name])
        point = np.array([one.free[0].normalised(0.02)])
        its = Alone(candidate=one, points=(point,), changes=change[None, :])
        beside = Beside(weights=White(), residuals=wanted, slopes=np.zeros((9, 0)), position=np.zeros(0))
        promise = best(beside.promises([its]))
        gains[name] = one.free[0].value(float(promise.point[0])), promise.gain
    assert gains["level_quantisation"] == pytest.approx((0.02, 9.0 * (9.0 - 4.0)))
    assert gains["static_head_bias"] == pytest.approx((0.06, 9.0 * 9.0))


def test_the_strongest_start_of_each_direction_goes_to_the_end_of_its_range():
    """Not so a limit: what it does has no slope."""
    (lift,), (cutoff,) = (candidates_of(1, 1, only=[name]) for name in ("static_head_bias", "flow_low_cutoff"))
    starts = {lift: (0.02, 0.1, -0.02), cutoff: (1.0, 2.0)}
    most = {
        one.name: Alone(
            candidate=one,
            points=tuple(np.array([one.free[0].normalised(value)]) for value in values),
            changes=np.zeros((len(values), 9)),
        ).most_scaled
        for one, values in starts.items()
    }
    high, low = lift.free[0].high, lift.free[0].low
    assert most["static_head_bias"] == pytest.approx([MOST_SCALED, high / 0.1, low / -0.02])
    assert most["flow_low_cutoff"] == pytest.approx([MOST_SCALED, MOST_SCALED])


def test_others_that_do_nearly_the_same_stay_within_their_ranges_together(alpha):
    """A slope and its reference go far against each other: each cut by itself, they would do anything."""
    truth = (
        EFFECTS["channel_delay"](channel="head_m", delay_s=9.0),
        EFFECTS["static_head_bias"](offset_m=-1.1),
        EFFECTS["control_delay"](delay_s=13.0),
    )
    fitter = fitter_of(alpha, truth)
    (grows,) = candidates_of(len(alpha.pump), 1, only=["level_dependent_static_head"])
    growing = fitter.refine(fitter.at([grows], [np.array([0.33, 0.0])]))
    promise = best(beside(fitter, growing).promises([alone(fitter, candidate(alpha, "control_delay"))]))
    assert promise.gain > 0.0


def test_candidates_are_weighed_few_at_a_time_as_they_would_be_alone(fitter, lag, alpha):
    names = ("water_inertia", "static_head_bias", "flow_meter_gain", "friction_bias", "head_sensor_offset")
    alones = [alone(fitter, candidate(alpha, name)) for name in names] * 2
    assert sum(len(one.points) for one in alones) > MOST_COLUMNS
    its = beside(fitter, lag)
    for together, one in zip(its.promises(alones), alones, strict=True):
        assert together[0].gain == pytest.approx(best(its.promises([one])).gain, rel=1e-6)
    assert its.promises([]) == []


def test_slopes_of_residuals_know_nothing_of_the_noise(fitter, alpha):
    """Else a lift up and a friction down, which cancel each other, leave some of the noise, and explain it."""
    bins, lift = fitter.bins, candidate(alpha, "static_head_bias")
    fit = fitter.at([lift], [np.array([lift.free[0].normalised(0.0)])])
    steady = (bins.signal == HEAD) & (bins.regime == STEADY)
    assert np.std(residuals_of(fit.residuals)[steady]) > 0.5
    moved_m = fitter.slopes(fit)[steady, 0] * bins.deviation[steady]
    assert moved_m == pytest.approx(moved_m.mean(), rel=1e-6)
    assert moved_m.mean() < -1.0


def test_the_size_of_the_noise_knows_nothing_of_the_noise(fitter):
    """Else what shifts all readings explains that those which happen to be high count less."""
    bins = fitter.bins
    steady = (bins.signal == FLOW) & (bins.regime == STEADY) & (bins.pump == 0)
    usual = np.median(bins.deviation[steady])
    assert np.mean(np.isclose(bins.deviation[steady], usual, rtol=1e-6)) > 0.5
