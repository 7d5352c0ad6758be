"""Intervals of parameters, and whether one says how large an effect is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.intervals import are_named, are_sized, intervals_of, sharpened
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation


def fit_of(*names):
    candidates = tuple(candidates_of(1, 1, only=[name])[0] for name in names)
    points = tuple(np.full(len(one.free), 0.5) for one in candidates)
    return Fit(candidates=candidates, points=points, residuals=np.zeros(0))


@pytest.mark.parametrize(
    ("low", "high", "is_sized"), [(0.4, 0.6, True), (0.0, 0.6, False), (0.0, 1.0, False), (0.02, 1.0, True)]
)
def test_an_only_strength_must_not_be_neutral(low, high, is_sized):
    """A leak of 0 is none. One of which only the least is known is there."""
    fit = fit_of("check_valve_leak")
    ends = np.array([[low, high] if free.neutral is not None else [0.0, 1.0] for free in fit.candidates[0].free])
    assert are_sized(fit, ends, fit.names) is is_sized


def test_of_several_strengths_one_may_be_neutral_and_what_is_no_strength_may_be_anything():
    fit = fit_of("pump_wear", "check_valve_leak")
    wear = [[0.0, 1.0] for _ in fit.candidates[0].free]
    leak = [[0.2, 0.3] if free.neutral is not None else [0.0, 1.0] for free in fit.candidates[1].free]
    assert are_sized(fit, np.array(wear + leak), fit.names)
    assert not are_sized(fit, np.array([*wear, [0.0, 0.3], *leak[1:]]), fit.names)


def test_a_companion_need_have_no_size():
    fit = fit_of("check_valve_leak", "water_inertia")
    leak = [[0.2, 0.3] for _ in fit.candidates[0].free]
    ends = np.array(leak + [[0.0, 1.0] for _ in fit.candidates[1].free])
    assert are_sized(fit, ends, ["check_valve_leak"])
    assert not are_sized(fit, ends, fit.names)


@pytest.mark.parametrize(
    ("name", "parameter"), [("ragging", "growth_s"), ("air_pocket", "purge_s"), ("static_head_bias", "offset_m")]
)
def test_what_may_be_another_effect_by_its_form_is_not_told(name, parameter):
    """Rags that are there at once are wear, air that no flow carries away is a lift, each main lifts something."""
    fit = fit_of(name)
    (number,) = (k for k, free in enumerate(fit.candidates[0].free) if free.name == parameter)
    ends = np.array([[0.2, 0.3] for _ in fit.candidates[0].free])
    assert are_sized(fit, ends, fit.names)
    ends[number] = [0.0, 1.0]
    assert not are_sized(fit, ends, fit.names)


def likelihood(size, precision, step=0.0):
    return SimpleNamespace(step=np.full(size, step), precision=precision * np.eye(size))


@pytest.mark.parametrize(
    ("precision", "low", "is_sized"), [(400.0, 0.5 - 1.96 / np.sqrt(401.0), True), (1.0, 0.0, False)]
)
def test_an_end_at_neutral_is_as_near_as_the_likelihood_lets_it_be(precision, low, is_sized):
    """It knows that what a level may be off in all steady seconds says nothing of ramps. The other end stays."""
    fit = fit_of("check_valve_leak")
    ends = np.array([[0.0, 0.9] if free.neutral is not None else [0.0, 1.0] for free in fit.candidates[0].free])
    sharp = sharpened(fit, ends, likelihood(len(ends), precision))
    assert sharp[0] == pytest.approx([low, 0.9])
    assert are_sized(fit, sharp, fit.names) is is_sized


def test_an_interval_holds_what_is_told_though_the_likelihood_has_it_larger():
    """A lag of 1 s beside a delay was told with an interval from 3.6 to 3.5 s."""
    fit = fit_of("check_valve_leak")
    ends = np.array([[0.0, 0.52] if free.neutral is not None else [0.0, 1.0] for free in fit.candidates[0].free])
    assert sharpened(fit, ends, likelihood(len(ends), 1e6, step=0.1))[0] == pytest.approx([0.5, 0.52])


def test_what_the_fit_knows_stays_as_it_is():
    fit = fit_of("check_valve_leak", "pump_wear")
    ends = np.array([[0.3, 0.9]] + [[0.0, 1.0]] * (fit.position.size - 1))
    assert sharpened(fit, ends, likelihood(len(ends), 400.0)) == pytest.approx(ends)


@pytest.mark.parametrize("name", ["ragging", "air_pocket"])
@pytest.mark.parametrize(("precision", "is_named"), [(400.0, True), (1.0, False)])
def test_what_may_be_another_effect_by_the_likelihood_has_no_name(name, precision, is_named):
    """A companion is too small to be told, whatever it is."""
    fit = fit_of(name, "pump_wear")
    found = likelihood(fit.position.size, precision)
    assert are_named(fit, found, fit.names) is is_named
    assert are_named(fit, found, ["pump_wear"])


def test_nothing_has_no_size_to_be_told():
    assert are_sized(Fit(candidates=(), points=(), residuals=np.zeros(0)), np.zeros((0, 2)), ())


class Valley:
    """A fitter of two parameters: the one is so far off a curve of the other, which hardly anything shows."""

    rows = np.ones(400, dtype=np.bool_)
    noise = np.random.default_rng(3).normal(size=400)

    def __init__(self, curve):
        self._curve = curve

    def residuals(self, x):
        away = 50.0 * (x[0] - 0.2 - self._curve(x[1] - 0.9))
        return self.noise + away + np.where(np.arange(400) < 4, 0.01 * (x[1] - 0.9), 0.0)

    def whole(self, candidates, points):
        """Both parameters, whichever is free."""
        values, left = dict(candidates[0].fixed), iter(points[0])
        known = {one.name: one for one in self.free}
        return np.array(
            [known[n].normalised(values[n]) if n in values else float(next(left)) for n in known], dtype=np.float64
        )

    def at(self, candidates, points):
        residuals = self.residuals(self.whole(candidates, points))
        return Fit(candidates=tuple(candidates), points=tuple(points), residuals=residuals)

    def refine(self, fit):
        def left(x):
            return self.residuals(self.whole(fit.candidates, [x]))

        found = least_squares(left, fit.points[0], bounds=(0.0, 1.0)).x
        return self.at(fit.candidates, (found,))

    def cost(self, fit):
        return float(np.sum(fit.residuals**2))

    def loss_slopes(self, fit):
        x, step = self.whole(fit.candidates, fit.points), 1e-6
        return np.column_stack([(self.residuals(x + step * one) - self.residuals(x)) / step for one in np.eye(2)])


@pytest.mark.parametrize(
    ("curve", "low", "high"),
    [
        pytest.param(lambda x: 0.5 * x**2, 0.2, 0.2 + 0.5 * 0.81, id="its slope is nothing at the fit"),
        pytest.param(
            lambda x: 0.05 * x, 0.2 - 0.05 * 0.9, 0.205, id="by its slope it may be anything, far out of range"
        ),
    ],
)
def test_beside_a_parameter_that_may_have_any_value_the_others_have_what_they_would_have_there(curve, low, high):
    fitter = Valley(curve)
    (wear,) = candidates_of(1, 1, only=["pump_wear"])
    wear = replace(wear, free=wear.free[:2])
    fitter.free = wear.free
    fit = fitter.at((wear,), (np.array([0.2, 0.9]),))
    bins = SimpleNamespace(**{name: np.zeros(400, dtype=int) for name in ("signal", "regime")})
    bins.cycle, bins.tolerance = np.arange(400) // 10, np.zeros(400)
    ends = intervals_of(fitter, fit, bins)
    assert ends[1] == pytest.approx([0.0, 1.0])
    assert ends[0] == pytest.approx([low, high], abs=0.01)


@pytest.mark.parametrize("cut", [np.round, np.floor])
def test_a_shift_of_thresholds_is_known_within_half_a_step_of_the_level(alpha, cut):
    (shift,) = candidates_of(len(alpha.pump), 1, only=["threshold_shift"])
    shifted = alpha.model_copy(update={"effect": (EFFECTS["threshold_shift"](start_m=0.06),)})
    traces = traces_of(Simulation(shifted, Scenario(name="plain"), 7, 0).advance(21_600, truth=False), alpha)
    traces = replace(traces, level_m=cut(traces.level_m / 0.04) * 0.04)
    replay = Replay(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes_of(traces, alpha), replay.run(), replay.doubt)
    fitter = Fitter(replay, residuals, np.ones(residuals.bins.second.size, dtype=bool))
    start = np.array([free.normalised(0.03 if free.name == "start_m" else 0.0) for free in shift.free])
    fit = fitter.refine(fitter.at((shift,), (start,)))
    for free, (low, high) in zip(shift.free, intervals_of(fitter, fit, residuals.bins), strict=True):
        assert free.value(low) <= (0.06 if free.name == "start_m" else 0.0) <= free.value(high)
        assert 0.04 <= free.value(high) - free.value(low) < 0.07
