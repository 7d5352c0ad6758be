"""Trials of a further effect beside others, and which sets are weighed."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.attribution.attribution import halves, weighed_cells
from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fitting import Fitter
from wetwell.sim2real.attribution.hypotheses import Hypotheses
from wetwell.sim2real.attribution.initial_guess import initial_guesses
from wetwell.sim2real.attribution.trials import Trials
from wetwell.sim2real.attribution.unnamed import unnamed
from wetwell.sim2real.correction.selection import Proposal
from wetwell.sim2real.correction.target import targets_of
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import residuals_of
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.sim2real.trial.cases import TrialCase
from wetwell.sim2real.truth import truth_plant
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation


class Searched(NamedTuple):
    fitter: Fitter
    cells: Cells
    hypotheses: Hypotheses
    trials: Trials


def searched(traces, station, candidates) -> Searched:
    """What a search of some candidates begins with."""
    regimes, replay = regimes_of(traces, station), Replay(traces, station)
    residuals = StationResiduals(traces, station, regimes, replay.run(), replay.doubt)
    fitter = Fitter(replay, residuals, halves(residuals.bins, traces.pumps)[0])
    guesses = {one: initial_guesses(one, replay, residuals, fitter.plain.residuals) for one in candidates}
    cells = weighed_cells(replay, residuals, residuals_of(fitter.plain.residuals))
    return Searched(
        fitter, cells, Hypotheses(fitter, cells, map), Trials(fitter, cells, guesses, lambda _: None, map)
    )


def of_all(station, name):
    """The candidate that acts on all pumps."""
    found = candidates_of(len(station.pump), len(station.mains), only=[name])
    return next(one for one in found if set(dict(one.fixed).values()) <= {0})


def recorded(station, truth):
    """Traces of a station with some effects."""
    tables = tuple(EffectTable.model_validate(one.model_dump()) for one in truth)
    plant = Simulation(station.model_copy(update={"effect": tables}), Scenario(name="plain"), 5, 0)
    return traces_of(plant.advance(28_800), station)


@pytest.mark.parametrize("start", [(0.1, 0.1, 0.1), (0.2, 0.4, 0.6), (0.5, 0.4, 0.1)])
@pytest.mark.parametrize("truth", [(0.72, 0.4, 0.9), (0.9, 0.5, 1.1), (0.6, 0.3, 0.8)])
def test_a_fit_ends_at_the_truth_from_afar(alpha, truth, start):
    """One of three parameters shows next to nothing: a step that is long in it must not hold the others back."""
    load = of_all(alpha, "load_dependent_power")
    names = ("share", "shutoff_share", "rated_factor")
    acting = EFFECTS["load_dependent_power"].model_validate(dict(zip(names, truth, strict=True)))
    fitter = searched(recorded(alpha, [acting]), alpha, [load]).fitter
    at_truth, begun = (fitter.at([load], [np.array(one)]) for one in (_places(load, truth), start))
    assert fitter.cost(fitter.refine(begun)) < 1.01 * fitter.cost(at_truth) < 0.1 * fitter.cost(begun)


def _places(candidate, values):
    return [free.normalised(value) for free, value in zip(candidate.free, values, strict=True)]


def test_a_set_is_weighed_without_what_it_does_not_need(alpha):
    """A search that took an effect first that another one does better later has tried no set without it."""
    names = ("static_head_bias", "flow_meter_gain", "friction_bias")
    lift, gain, friction = (of_all(alpha, name) for name in names)
    truth = [EFFECTS["static_head_bias"](offset_m=2.0), EFFECTS["flow_meter_gain"](factor=1.1)]
    fitter, _, hypotheses, _ = searched(recorded(alpha, truth), alpha, [lift, gain, friction])
    nothing = friction.neutral(np.array([free.normalised(free.start) for free in friction.free]))
    hypotheses.add([fitter.refine(fitter.at([friction, gain, lift], [nothing, np.array([0.3]), np.array([0.4])]))])
    assert hypotheses.possible[0].told == ("flow_meter_gain", "static_head_bias")


@pytest.mark.parametrize("is_nearer", [True, False])
def test_what_leaves_the_simulator_further_from_a_recording_than_nothing_is_no_answer(alpha, monkeypatch, is_nearer):
    """However likely it is: the likelihood may prize what scatters less more than what is far off in all cycles."""
    friction = of_all(alpha, "friction_bias")
    fitter, _, hypotheses, _ = searched(recorded(alpha, [EFFECTS["friction_bias"](factor=1.3)]), alpha, [friction])
    found = fitter.refine(fitter.at([friction], [friction.neutral(np.array([0.3] * len(friction.free)))]))
    measured = fitter.cost
    monkeypatch.setattr(fitter, "cost", lambda fit: measured(fit) if is_nearer else -measured(fit))
    weighed = hypotheses.scales.weigh(found)
    assert weighed.told == ("friction_bias",)
    assert weighed.is_possible == is_nearer


def test_what_explains_less_of_the_loss_than_a_limit_is_weighed_where_it_surprises_more(alpha):
    """A limit takes seconds of starts away, in which a right model is often wrong."""
    area, limit = of_all(alpha, "sump_area_profile"), of_all(alpha, "flow_low_cutoff")
    truth = [
        EFFECTS["water_inertia"](inertia_s2_m2=1500.0),
        EFFECTS["sump_area_profile"](bottom_factor=0.92, height_m=1.2),
    ]
    fitter, _, hypotheses, trials = searched(recorded(alpha, truth), alpha, [area, limit])
    singles = trials.singles()
    explained = {fit.names[0]: fitter.cost(fitter.plain) - fitter.cost(fit) for fit in singles}
    assert explained["sump_area_profile"] < 0.4 * explained["flow_low_cutoff"]
    hypotheses.add(singles)
    assert hypotheses.possible[0].told == ("sump_area_profile",)


def test_steps_that_the_values_show_are_tried_though_others_promise_more(alpha, monkeypatch):
    """What they do to a level that is wrong says little of what they do to one that is right."""
    monkeypatch.setattr("wetwell.sim2real.attribution.trials.MOST_TRIED", 1)
    truth = [
        EFFECTS["sump_area_profile"](bottom_factor=0.4, height_m=1.2),
        EFFECTS["level_quantisation"](quantum_m=0.04),
        EFFECTS["static_head_bias"](offset_m=5.0),
    ]
    candidates = [of_all(alpha, one.name) for one in truth]
    fitter, _, hypotheses, trials = searched(recorded(alpha, truth), alpha, candidates)
    (area,) = (fit for fit in trials.singles() if fit.names == ("sump_area_profile",))
    (both,) = trials.with_one_more([area], hypotheses.beside([area]))
    assert both.names == ("sump_area_profile", "level_quantisation")
    assert fitter.cost(both) < fitter.cost(area)


def test_what_an_effect_does_beside_a_header_is_tried_in_that_layout(alpha):
    """Pumps with mains of their own lose nothing through the valves of others: alone a leak does nothing."""
    header, leak = of_all(alpha, "common_header"), of_all(alpha, "check_valve_leak")
    truth = [EFFECTS["common_header"](shared_fraction=0.9), EFFECTS["check_valve_leak"](leak_m3h=6.0)]
    fitter, _, hypotheses, trials = searched(recorded(alpha, truth), alpha, [header, leak])
    alone = fitter.refine(fitter.at([header], [np.array([0.8])]))
    (both,) = trials.with_one_more([alone], hypotheses.beside([alone]))
    (found,) = (effect for effect in both.effects if effect.name == "check_valve_leak")
    assert found.leak_m3h == pytest.approx(6.0, rel=0.1)


def test_what_an_effect_does_beside_a_held_channel_is_tried_there(alpha):
    """A head that is sent when it has moved by two metres shows hardly any of a lift."""
    reports = candidates_of(3, 1, only=["report_by_exception"])
    held = next(one for one in reports if ("channel", "head_m") in one.fixed)
    lift = of_all(alpha, "static_head_bias")
    truth = [
        EFFECTS["report_by_exception"](channel="head_m", deadband=2.0),
        EFFECTS["static_head_bias"](offset_m=1.5),
    ]
    fitter, _, hypotheses, trials = searched(recorded(alpha, truth), alpha, [held, lift])
    (alone,) = (fit for fit in trials.singles() if fit.names == ("report_by_exception",))
    (beside,) = hypotheses.beside([alone])
    ((promise,),) = beside.promises([trials._alones(alone)[lift]])
    replayed = fitter.at([held, lift], [*alone.points, promise.point])
    ((kept,),) = beside.promises([trials._doing(alone, [replayed])])
    assert promise.gain == pytest.approx(kept.gain, rel=0.1)


@pytest.mark.check
def test_a_limit_that_leads_astray_beside_a_header_is_tried_from_another_start():
    """Four pumps share a main, so that each moves little, and its meter reads 0 under 30 m³/h.

    As if all were linear, a limit of 60 m³/h and no header would do; it leaves more than the header alone.
    """
    names = ("common_header", "flow_low_cutoff")
    truth = TrialCase(seed=1_003_001, number=1, kind="pair", plant="fine", names=names, seconds=86_400).truth()
    traces = traces_of(truth_plant.run(truth), truth.station)
    header, cutoff = (
        candidates_of(traces.pumps, len(truth.station.mains), only=[name])[0]
        for name in ("common_header", "flow_low_cutoff")
    )
    fitter, _, hypotheses, trials = searched(traces, truth.station, [header, cutoff])
    alone = fitter.refine(fitter.at([header], [np.array([0.8])]))
    (both,) = trials.with_one_more([alone], hypotheses.beside([alone]))
    assert both.names == ("common_header", "flow_low_cutoff")
    assert fitter.cost(both) < 0.5 * fitter.cost(alone)
    (limit,) = (effect for effect in both.effects if effect.name == "flow_low_cutoff")
    assert limit.cutoff_m3h == pytest.approx(truth.deviations[1].parameters["cutoff_m3h"], rel=0.06)


def test_near_sets_are_settled_where_the_recording_is_likeliest(alpha):
    """The friction, which is the truth, is behind only because it was fitted too high."""
    traces = recorded(alpha, [EFFECTS["friction_bias"](factor=1.2)])
    friction, lift = (of_all(alpha, name) for name in ("friction_bias", "static_head_bias"))
    fitter, _, hypotheses, _ = searched(traces, alpha, [friction, lift])
    best = fitter.refine(fitter.at([lift], [lift.start_grids({"offset_m": 1.0})[0][0]]))
    loss_exponent = friction.free[1].normalised(2.0)
    off = fitter.at([friction], [np.array([friction.free[0].normalised(1.3), loss_exponent])])
    hypotheses.add([best, off])
    assert hypotheses.weighed[0].told == ("static_head_bias",)
    hypotheses.settle()
    settled = hypotheses.of(["friction_bias"])
    assert settled.fit.effects[0].factor == pytest.approx(1.2, abs=0.01)
    assert hypotheses.weighed[0] is settled


def test_an_answer_is_held_against_the_likeliest_set_that_tells_it(alpha, monkeypatch):
    """Beside water that is slow by a second the friction is another one."""
    friction, inertia = (of_all(alpha, name) for name in ("friction_bias", "water_inertia"))
    traces = recorded(alpha, [EFFECTS["friction_bias"](factor=1.5)])
    fitter, _, hypotheses, trials = searched(traces, alpha, [friction])
    hypotheses.add(trials.singles())
    alone = hypotheses.of(["friction_bias"])
    both = fitter.at([*alone.fit.candidates, inertia], [*alone.fit.points, np.array([0.01, 0.0])])
    beside = replace(alone, fit=both, evidence=replace(alone.evidence, log=alone.evidence.log + 1.0))
    assert hypotheses.telling(["friction_bias"]) is alone
    monkeypatch.setitem(hypotheses._best, beside.effects, beside)
    assert hypotheses.telling(["friction_bias"]) is beside


def test_a_promise_that_no_replay_keeps_does_not_count(alpha, monkeypatch):
    traces = recorded(alpha, [EFFECTS["friction_bias"](factor=1.2)])
    friction, lift = (of_all(alpha, name) for name in ("friction_bias", "static_head_bias"))
    _, _, hypotheses, trials = searched(traces, alpha, [friction, lift])
    hypotheses.add(trials.singles())
    log = hypotheses.of(["friction_bias"]).evidence.log

    def at(one, log, gained):
        return replace(one, evidence=replace(one.evidence, log=log, gained=gained))

    for name, promised in (("friction_bias", 5.0), ("static_head_bias", 600.0)):
        one = hypotheses.of([name])
        monkeypatch.setitem(hypotheses._best, one.effects, at(one, log + 10.0, promised))
    steps = "wetwell.sim2real.attribution.weighing.settling._steps"
    monkeypatch.setattr(steps, lambda _, one: iter([at(one, log - 1000.0, 0.0)]))
    hypotheses.settle()
    assert hypotheses.of(["friction_bias"]).evidence.log == pytest.approx(log + 5.0)
    assert hypotheses.of(["static_head_bias"]).evidence.log == pytest.approx(log - 590.0)


def test_a_correction_that_says_what_a_set_says_is_that_set(alpha):
    traces = recorded(alpha, [EFFECTS["friction_bias"](factor=1.2)])
    friction, lift = (of_all(alpha, name) for name in ("friction_bias", "static_head_bias"))
    loss = next(one for one in targets_of(plant_parameters(alpha)) if one.term == "head_loss")
    correction, point = unnamed(Proposal(target=loss, atoms=(), sizes=np.array([0.2]), log=1.0))
    for library, are_apart in (([lift], [True]), ([friction, lift], [])):
        fitter, _, hypotheses, trials = searched(traces, alpha, library)
        hypotheses.add(trials.singles())
        hypotheses.add_unnamed([fitter.at([correction], [point])])
        assert [one.is_apart for one in hypotheses.unnamed_weights()] == are_apart


def test_the_most_promising_pair_is_tried_from_either_part_once(alpha):
    truth = [EFFECTS["flow_meter_gain"](factor=1.1), EFFECTS["head_sensor_offset"](offset_m=1.2)]
    pair = {"flow_meter_gain", "head_sensor_offset"}
    candidates = [of_all(alpha, name) for name in (*pair, "check_valve_leak", "friction_bias")]
    fitter, _, hypotheses, trials = searched(recorded(alpha, truth), alpha, candidates)
    hypotheses.add(trials.singles())
    bases = [one.fit for one in hypotheses.possible if len(one.effects) == 1]
    besides = hypotheses.beside(bases)
    first, *others = trials.of_pairs(bases, besides, hypotheses.known)
    assert set(first.names) == pair
    assert fitter.cost(first) < min(fitter.cost(fit) for fit in bases)
    assert pair not in [set(fit.names) for fit in others]
    known = hypotheses.known | {frozenset(pair)}
    assert pair not in [set(fit.names) for fit in trials.of_pairs(bases, besides, known)]


def test_what_does_the_like_alone_takes_the_place_of_an_effect_in_a_set(alpha):
    """A friction does nearly what a lift does; a meter does neither's work."""
    lift, gain, friction = (of_all(alpha, name) for name in ("static_head_bias", "flow_meter_gain", "friction_bias"))
    traces = recorded(alpha, [EFFECTS["static_head_bias"](offset_m=2.0), EFFECTS["flow_meter_gain"](factor=1.1)])
    fitter, _, hypotheses, trials = searched(traces, alpha, [lift, gain, friction])
    hypotheses.add(trials.singles())
    rough = friction.start_grids({"factor": 1.3})[0][0]
    best = fitter.refine(fitter.at([friction, gain], [rough, gain.start_grids({"factor": 1.1})[0][0]]))
    (beside,) = hypotheses.beside([best])
    (found,) = trials.exchanged(best, beside.weights, {frozenset(best.names)})
    assert found.names == ("flow_meter_gain", "static_head_bias")
    assert found.effects[1].offset_m == pytest.approx(2.0, abs=0.05)
    assert trials.exchanged(best, beside.weights, {frozenset(best.names), frozenset(found.names)}) == []
