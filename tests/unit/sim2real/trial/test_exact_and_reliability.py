"""Exact sets, probabilities that hold or do not, kinds with several effects."""

import numpy as np
import pytest

from wetwell.sim2real.trial.answer import answer_of
from wetwell.sim2real.trial.cases import trial_case
from wetwell.sim2real.trial.families import FAMILIES, PLANTS
from wetwell.sim2real.trial.reliability import reliability
from wetwell.sim2real.trial.scores import Label, score_case


def label(kind, *names, inherent=()):
    return Label(
        case="case-0000",
        kind=kind,
        plant="fine",
        names=names,
        components=("pump",) * len(names),
        parameters={},
        inherent=inherent,
    )


def answer(verdict, *effects, posterior=(), not_tested=()):
    told = [{"name": name, "equivalent": list(equivalent)} for name, *equivalent in effects]
    given = [{"verdict": v, "effects": list(names), "probability": p} for v, names, p in posterior]
    untested = [{"effect": name} for name in not_tested]
    return answer_of({"verdict": verdict, "effects": told, "posterior": given, "not_tested": untested})


@pytest.mark.parametrize(
    ("truth", "given", "exact"),
    [
        (label("single", "a"), answer("effect", ["a"]), True),
        (label("single", "a"), answer("effect", ["b", "a"]), True),
        (label("single", "a"), answer("effect", ["a"], ["b"]), False),
        (label("single", "a"), answer("unknown"), False),
        (label("single", "a", inherent=("w",)), answer("effect", ["a"], ["w"]), True),
        (label("pair", "a", "b"), answer("effect", ["b"], ["a"]), True),
        (label("pair", "a", "b"), answer("effect", ["b", "a"]), False),
        (label("pair", "a", "b"), answer("effect", ["b", "a"], ["b", "a"]), True),
        (label("pair", "a", "b"), answer("effect", ["a"], not_tested=["b"]), True),
        (label("triple", "a", "b", "c"), answer("effect", ["c"], ["a"], ["b"]), True),
        (label("triple", "a", "b", "c"), answer("effect", ["c"], ["a"]), False),
        (label("none"), answer("none"), True),
        (label("none"), answer("effect", ["a"]), False),
        (label("open", "z"), answer("unknown"), True),
        (label("leave_one_out", "a"), answer("effect", ["b"]), False),
        (label("single", "a"), None, False),
    ],
)
def test_an_exact_set_has_nothing_missing_and_nothing_beside_it(truth, given, exact):
    assert score_case(truth, given).exact_set is exact


@pytest.mark.parametrize(
    ("truth", "given", "exact", "equivalents"),
    [
        (label("single", "a"), answer("effect", ["a"]), True, (0,)),
        (label("single", "a"), answer("effect", ["b", "a", "c"]), False, (2,)),
        (label("pair", "a", "b"), answer("effect", ["b", "c"], ["a"]), True, (1, 0)),
        (label("single", "a"), answer("none"), False, ()),
        (label("none"), answer("none"), True, ()),
        (label("none"), answer("effect", ["a"]), False, (0,)),
        (label("open", "z"), answer("unknown"), True, ()),
        (label("leave_one_out", "a"), answer("effect", ["b", "a"]), False, (1,)),
        (label("single", "a"), None, False, ()),
    ],
)
def test_what_is_exact_by_name_has_no_need_of_equivalents(truth, given, exact, equivalents):
    scored = score_case(truth, given)
    assert (scored.exact_by_name, scored.equivalents) == (exact, equivalents)


@pytest.mark.parametrize(
    ("truth", "posterior", "said"),
    [
        (label("single", "a"), [("effect", ["a"], 0.7), ("none", [], 0.3)], (0.7, True)),
        (label("single", "a"), [("effect", ["a", "b"], 0.7), ("effect", ["a"], 0.3)], (0.7, False)),
        (label("none", inherent=("w",)), [("effect", ["w"], 0.9), ("none", [], 0.1)], (0.9, True)),
        (label("open", "z"), [("unknown", [], 0.6), ("none", [], 0.4)], (0.6, True)),
        (label("none"), [], None),
    ],
)
def test_what_is_said_is_the_answer_given_most(truth, posterior, said):
    assert score_case(truth, answer("none", posterior=posterior)).said == said


def test_answers_that_are_as_often_right_as_they_say_have_no_more_error_than_chance_makes():
    rng = np.random.default_rng(1)
    said = rng.uniform(0.3, 1.0, 2000)
    held = reliability([(p, bool(rng.random() < p)) for p in said.tolist()])
    bold = reliability([(p, bool(rng.random() < 0.6 * p)) for p in said.tolist()])
    assert held["calibration_error"] < 2.0 * held["chance"] < 0.05
    assert bold["calibration_error"] == pytest.approx(0.4 * said.mean(), abs=0.03)
    assert sum(one["cases"] for one in held["bins"]) == 2000
    assert reliability([]) is None


def test_what_is_told_with_the_same_probability_but_for_rounding_is_in_one_bin():
    found = reliability([(0.8, True)] * 3 + [(0.799999, False)])
    (only,) = found["bins"]
    assert (only["from"], only["to"], only["cases"], only["right"]) == (0.75, 0.85, 4, 0.75)
    assert found["calibration_error"] == pytest.approx(0.05, abs=1e-5)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_triple_lies_in_three_components(plant):
    for number in range(12):
        case = trial_case(7, number, kinds=("triple",), plants=(plant,), seconds=600)
        assert len(set(case.components)) == len(case.names) == 3
        assert set(case.names) <= set(FAMILIES[plant].library)
