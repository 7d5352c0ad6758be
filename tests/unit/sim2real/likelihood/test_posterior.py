"""Probabilities of answers from what they are weighed with."""

import numpy as np
import pytest

from wetwell.sim2real.likelihood.posterior import (
    CREDIBLE,
    FURTHER_PRIOR,
    UnnamedWeight,
    Weight,
    best_set,
    equivalents,
    posterior_of,
    shared,
    unknown_shares,
    verdict_of,
)

NONE = Weight(effects=(), acting=(), log=0.0, log_flexible=-9.0)


def weight(*effects, log, log_flexible=-9.0):
    return Weight(effects=effects, acting=effects, log=log, log_flexible=log_flexible)


def correction(log, *acting, log_flexible=-9.0, is_apart=True):
    return UnnamedWeight(
        acting=acting, component="rising_main", log=log, log_flexible=log_flexible, is_apart=is_apart
    )


def test_probabilities_sum_to_1_and_the_best_comes_first():
    rng = np.random.default_rng(3)
    weights = [NONE, *(weight(f"effect {k}", log=float(rng.normal()), log_flexible=-np.inf) for k in range(20))]
    posterior = posterior_of(weights, 20)
    assert sum(one.probability for one in posterior) == pytest.approx(1.0)
    assert [one.probability for one in posterior] == sorted((one.probability for one in posterior), reverse=True)


@pytest.mark.parametrize(
    ("weights", "verdict"),
    [
        ([NONE, weight("ragging", log=2.0)], "none"),  # not worth a name
        ([NONE, weight("ragging", log=500.0)], "effect"),
        ([NONE, weight("ragging", log=500.0, log_flexible=60.0)], "unknown"),  # leaves what it cannot do
        ([Weight(effects=(), acting=(), log=0.0, log_flexible=60.0), weight("ragging", log=5.0)], "unknown"),
        ([Weight(effects=(), acting=(), log=0.0, log_flexible=60.0), weight("ragging", log=80.0)], "effect"),
    ],
)
def test_the_verdict_is_what_is_most_probable(weights, verdict):
    assert verdict_of(posterior_of(weights, 25)) == verdict


@pytest.mark.parametrize(("log", "verdict"), [(490.0, "effect"), (520.0, "unknown")])
def test_what_corrects_a_term_better_than_any_set_is_unknown(log, verdict):
    sets = [NONE, weight("static_head_bias", log=500.0)]
    assert verdict_of(posterior_of(sets, 25, unnamed=[correction(log)])) == verdict


def test_something_unknown_may_have_another_form_than_its_correction():
    sets = [NONE, weight("static_head_bias", log=500.0)]
    for log_flexible, verdict in ((-9.0, "effect"), (60.0, "unknown")):
        near = correction(460.0, log_flexible=log_flexible)
        assert verdict_of(posterior_of(sets, 25, unnamed=[near])) == verdict


def test_a_correction_that_is_a_set_says_where_and_no_more():
    sets = [NONE, weight("static_head_bias", log=500.0, log_flexible=10.0)]
    same = correction(600.0, is_apart=False)
    assert posterior_of(sets, 25, unnamed=[same]) == posterior_of(sets, 25)
    where = unknown_shares(sets, 25, unnamed=[same])
    assert max(where, key=lambda one: one.share).component == "rising_main"
    assert sum(one.share for one in where) == pytest.approx(1.0)


def test_a_correction_beside_an_effect_costs_what_the_effect_does():
    alone, beside = (posterior_of([NONE], 25, unnamed=[correction(3.0, *acting)]) for acting in ((), ("ragging",)))
    assert alone[0].verdict == "unknown"
    assert beside[0].verdict == "none"


def test_a_further_effect_has_to_earn_its_place():
    pair = ("motor_slip", "ragging")
    for gain, expected in ((2.0, ("ragging",)), (20.0, pair)):
        posterior = posterior_of([NONE, weight("ragging", log=900.0), weight(*pair, log=900.0 + gain)], 25)
        assert best_set(posterior) == expected


def test_what_acts_too_little_to_be_told_speaks_for_what_is_told():
    left = weight("ragging", log=500.0, log_flexible=30.0)
    beside = Weight(effects=("ragging",), acting=("ragging", "water_inertia"), log=540.0, log_flexible=-9.0)
    assert verdict_of(posterior_of([NONE, left], 25)) == "unknown"
    posterior = posterior_of([NONE, left, beside], 25)
    assert (verdict_of(posterior), best_set(posterior)) == ("effect", ("ragging",))
    assert len(posterior) == 3, "none, unknown, and the one answer that two sets tell"


def test_sets_that_the_data_do_not_rule_out_name_the_equivalents():
    sets = [
        weight("friction_bias", log=900.0),
        weight("static_head_bias", log=899.0),
        weight("pump_wear", log=800.0),
        weight("friction_bias", "ragging", log=897.0),
    ]
    posterior = posterior_of([NONE, *sets], 25)
    assert equivalents(posterior, ("friction_bias",)) == {"friction_bias": ("static_head_bias",)}
    assert 0.5 < CREDIBLE < 1.0


def only(*pairs):
    """Sets are alike if they are one of the pairs."""
    return lambda effects, others: [other for other in others if {effects, other} in [{*pair} for pair in pairs]]


def test_what_differs_by_nothing_that_matters_is_equivalent_however_clear_the_likelihood_is():
    lift, friction, wear = (("static_head_bias",), ("friction_bias",), ("pump_wear",))
    sets = [weight(*lift, log=900.0), weight(*friction, log=870.0), weight(*wear, log=899.0)]
    posterior = posterior_of([NONE, *sets], 25)
    assert equivalents(shared(posterior, only()), lift) == {"static_head_bias": ("pump_wear",)}
    after = shared(posterior, only((lift, friction)))
    assert {*equivalents(after, lift)["static_head_bias"]} == {"pump_wear", "friction_bias"}
    assert sum(one.probability for one in after) == pytest.approx(1.0)
    probabilities = [one.probability for one in after]
    assert probabilities == pytest.approx(sorted(probabilities, reverse=True), abs=1e-6)
    assert verdict_of(after) == verdict_of(posterior)
    before, told = ({one.effects: one.probability for one in each} for each in (posterior, after))
    assert [told[lift], told[friction]] == pytest.approx([0.5 * before[lift]] * 2, rel=1e-6)
    assert best_set(after) == lift, "which is the likelier of two that share"
    assert told[wear] == pytest.approx(before[wear], rel=1e-12)


def test_of_sets_that_are_alike_the_one_of_fewer_effects_is_more_probable():
    """A slip does what wear and a power that follows the load do together: nothing but the price parts them."""
    slip, both = ("motor_slip",), ("load_dependent_power", "pump_wear")
    posterior = posterior_of([NONE, weight(*slip, log=900.0), weight(*both, log=940.0)], 25)
    assert best_set(posterior) == both
    after = shared(posterior, only((slip, both)))
    told = {one.effects: one.probability for one in after}
    assert best_set(posterior, only((slip, both))) == best_set(after) == slip
    assert told[both] == pytest.approx(FURTHER_PRIOR * told[slip])
    assert sum(one.probability for one in after) == pytest.approx(1.0)
    assert best_set(posterior, only()) == both


def test_of_as_many_effects_the_likelier_of_sets_that_are_alike_is_told():
    lift, sloped, friction = (("static_head_bias",), ("level_dependent_static_head",), ("friction_bias",))
    sets = [weight(*lift, log=900.0), weight(*sloped, log=893.0), weight(*friction, log=800.0)]
    posterior = posterior_of([NONE, *sets], 25)
    assert best_set(posterior, lambda _, others: others) == lift
    assert best_set(posterior_of([NONE], 25), lambda _, others: others) == ()


def test_all_of_many_that_are_alike_are_equivalent():
    names = [f"effect {k}" for k in range(9)]
    posterior = posterior_of([NONE, *(weight(name, log=900.0 - 20.0 * k) for k, name in enumerate(names))], 25)
    after = shared(posterior, lambda _, others: others)
    assert best_set(after) == ("effect 0",)
    assert equivalents(after, ("effect 0",)) == {"effect 0": tuple(names[1:])}


def test_no_equivalents_without_effects():
    assert shared(posterior_of([NONE], 25), only()) == posterior_of([NONE], 25)
    assert equivalents(posterior_of([NONE], 25), ()) == {}
