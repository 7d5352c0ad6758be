"""Probabilities of answers from what they are weighed with."""

import numpy as np
import pytest

from wetwell.sim2real.likelihood.posterior import (
    CREDIBLE,
    Weight,
    best_set,
    equivalents,
    posterior_of,
    verdict_of,
)

NONE = Weight(effects=(), acting=(), log=0.0, log_flexible=-9.0)


def weight(*effects, log, log_flexible=-9.0):
    return Weight(effects=effects, acting=effects, log=log, log_flexible=log_flexible)


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


def test_no_equivalents_without_effects():
    assert equivalents(posterior_of([NONE], 25), ()) == {}
