"""Scores of single answers, the gap on unseen recordings, and the regressor."""

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Sensors
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.trial.answer import answer_of
from wetwell.sim2real.trial.holdout import gap, shrinkage, whitened
from wetwell.sim2real.trial.regressor import corrected
from wetwell.sim2real.trial.scores import Label, chance_level, confusion, score_case, share, summary
from wetwell.sim2real.trial.seal import digest, labels_text, opened
from wetwell.sim2real.truth import truth_plant
from wetwell.sim2real.truth.case import TrueInflow, TruthCase


def label(kind="single", names=("motor_slip",), components=("drive",), parameters=None, inherent=()):
    return Label(
        case="case-0000",
        kind=kind,
        plant="fine",
        names=names,
        components=components,
        parameters=parameters or {},
        inherent=inherent,
    )


def answer(verdict="effect", effects=(), where=("drive",), **more):
    return answer_of({"verdict": verdict, "effects": effects, "where": [{"component": c} for c in where], **more})


def told(*names, equivalent=()):
    return [{"name": name, "equivalent": list(equivalent)} for name in names]


@pytest.mark.parametrize(
    ("given", "verdict_right", "top_1", "top_2"),
    [
        (answer(effects=told("motor_slip")), True, True, True),
        (answer(effects=told("pump_wear")), True, False, False),
        (answer(effects=told("pump_wear", equivalent=["motor_slip"])), True, False, True),
        (
            answer(effects=told("pump_wear"), candidates=[{"name": "pump_wear"}, {"name": "motor_slip"}]),
            True,
            False,
            True,
        ),
        (answer(effects=told("pump_wear", "ragging", "motor_slip")), True, False, False),
        (answer("unknown", candidates=[{"name": "motor_slip"}]), False, False, False),
        (answer("none"), False, False, False),
        (None, False, False, False),
    ],
)
def test_single(given, verdict_right, top_1, top_2):
    score = score_case(label(), given)
    assert (score.verdict_right, score.top_1, score.top_2) == (verdict_right, top_1, top_2)


@pytest.mark.parametrize(
    ("effects", "top_1", "top_2"),
    [
        (told("a", "b"), True, True),
        (told("b", "a"), True, True),
        (told("a"), True, False),
        (told("a", "c"), True, False),
        ([{"name": "c", "equivalent": ["b"]}, {"name": "a"}], False, True),
        ([{"name": "a", "equivalent": ["b"]}], True, False),
    ],
)
def test_pair(effects, top_1, top_2):
    score = score_case(label("pair", ("a", "b"), ("pump", "drive")), answer(effects=effects))
    assert (score.top_1, score.top_2) == (top_1, top_2)


@pytest.mark.parametrize(
    ("kind", "given", "is_right"),
    [
        ("open", answer("unknown"), True),
        ("open", answer(effects=told("pump_wear")), False),
        ("open", answer("none"), False),
        ("leave_one_out", answer("unknown"), True),
        ("leave_one_out", answer(effects=told("pump_wear")), False),
        ("leave_one_out", answer(effects=told("pump_wear", equivalent=["motor_slip"])), True),
    ],
)
def test_outside_of_the_library(kind, given, is_right):
    score = score_case(label(kind), given)
    assert score.verdict_right is is_right
    assert score.top_1 is score.top_2 is score.shrinkage is None


def test_what_the_whole_library_cannot_tell_apart_is_right_for_the_one_left_out():
    true = label("leave_one_out", ("motor_slip",))
    one = answer(effects=told("pump_wear"))
    assert score_case(true, one, answer(effects=told("motor_slip", equivalent=["pump_wear"]))).verdict_right
    assert score_case(true, one, answer(effects=told("pump_wear", equivalent=["motor_slip"]))).verdict_right
    assert not score_case(true, one, answer(effects=told("motor_slip", equivalent=["ragging"]))).verdict_right
    assert not score_case(label("open"), one, answer(effects=told("pump_wear"))).verdict_right


def untested(*names):
    return [{"effect": name, "reason": "no such signal"} for name in names]


@pytest.mark.parametrize(
    ("given", "verdict_right"),
    [
        (answer("none", not_tested=untested("motor_slip")), True),
        (answer("unknown", not_tested=untested("motor_slip")), None),
        (answer(effects=told("pump_wear"), not_tested=untested("motor_slip")), False),
        (answer("none", not_tested=untested("pump_wear")), False),
    ],
)
def test_what_was_not_tested_is_in_its_own_column(given, verdict_right):
    score = score_case(label(), given)
    assert score.verdict_right is verdict_right
    is_untested = "motor_slip" in given.untested
    assert score.not_tested == (("motor_slip",) if is_untested else ())
    assert score.is_tested is not is_untested
    if is_untested:
        assert score.top_1 is score.top_2 is score.component_right is score.shrinkage is None
    _, columns, counts = confusion([score])
    expected = score.told_names[0] if score.told_names else "not tested" if is_untested else "none"
    assert columns == [expected]
    assert counts.sum() == 1
    assert summary([score])["not_tested"] == int(is_untested)


@pytest.mark.parametrize(
    ("effects", "top_1", "top_2"),
    [(told("b"), True, True), (told("c", equivalent=["b"]), False, True), (told("a"), False, False)],
)
def test_of_a_pair_the_effect_that_was_tested_is_asked_for(effects, top_1, top_2):
    pair = label("pair", ("a", "b"), ("pump", "drive"))
    score = score_case(pair, answer(effects=effects, where=("drive",), not_tested=untested("a")))
    assert (score.verdict_right, score.top_1, score.top_2) == (True, top_1, top_2)
    assert score.component_right is True
    assert score.not_tested == ("a",)
    assert score.is_tested
    assert (
        score_case(pair, answer(effects=effects, where=("pump",), not_tested=untested("a"))).component_right is False
    )


def test_a_name_left_out_may_be_told_as_not_tested_by_the_whole_library():
    true = label("leave_one_out", ("motor_slip",))
    assert not score_case(true, answer("none")).verdict_right
    assert score_case(true, answer("none"), answer("none", not_tested=untested("motor_slip"))).verdict_right


def test_none_and_component():
    nothing = label("none", (), ())
    assert score_case(nothing, answer("none")).false_attribution is False
    assert score_case(nothing, answer(effects=told("pump_wear"))).false_attribution is True
    assert score_case(nothing, answer("none")).component_right is None
    assert score_case(label(), answer("unknown", where=("pump", "drive"))).component_right is False
    assert score_case(label("open"), answer("unknown", where=("drive",))).component_right is True


def test_what_a_plant_always_has_counts_neither_way():
    swmm = {"inherent": ("water_inertia",)}
    score = score_case(label("none", (), (), **swmm), answer(effects=told("water_inertia")))
    assert score.verdict_right
    assert not score.false_attribution
    assert score_case(label(**swmm), answer(effects=told("water_inertia", "motor_slip"))).top_1
    true = label(names=("water_inertia",), **swmm)
    assert score_case(true, answer(effects=told("water_inertia"))).top_1


def test_parameters():
    effects = [
        {
            "name": "motor_slip",
            "parameters": {
                "slip": {"value": 0.05, "ci": [0.03, 0.06]},
                "pump": {"value": 1, "ci": None},
                "other": {"value": 3.0, "ci": [1.0, 2.0]},
            },
        }
    ]
    truth = label(parameters={"motor_slip": {"slip": 0.04, "pump": 1.0}})
    (row,) = score_case(truth, answer(effects=effects)).parameters
    assert row["relative_error"] == pytest.approx(0.25)
    assert row["is_covered"] is True
    assert score_case(truth, answer(effects=told("pump_wear"))).parameters == ()


def test_chance_level_of_labels_that_are_all_alike_is_one_and_of_many_is_low():
    alike = [(label(), answer(effects=told("motor_slip")))] * 4
    assert chance_level(alike, np.random.default_rng(1))["top_1"] == 1.0
    many = [(label(names=(f"e{k}",)), answer(effects=told(f"e{k}"))) for k in range(20)]
    assert chance_level(many, np.random.default_rng(1))["top_1"] == pytest.approx(0.05, abs=0.02)


def test_confusion_counts_each_case_once():
    scores = [
        score_case(label(), answer(effects=told("pump_wear"))),
        score_case(label(), answer(effects=told("motor_slip"))),
        score_case(label("none", (), ()), answer("none")),
        score_case(label("pair", ("a", "b"), ("pump", "drive")), None),
        score_case(label("open", ("foam",)), answer("effect")),
    ]
    rows, columns, counts = confusion(scores)
    assert counts.sum() == len(scores)
    assert counts[rows.index("motor_slip"), columns.index("pump_wear")] == 1
    assert counts[rows.index("pair"), columns.index("failed")] == 1
    assert counts[rows.index("open: foam"), columns.index("effect")] == 1
    assert summary(scores)["verdict_right"]["value"] == pytest.approx(3 / 5)


def test_wilson_interval():
    assert share([True] * 10)["ci"] == pytest.approx([0.7225, 1.0], abs=1e-4)


def test_seal_is_refused_when_a_byte_differs():
    text = labels_text({"kind": "none"}, "ab")
    with pytest.raises(ValueError, match="not what was sealed"):
        opened(text.replace(b"none", b"open"), digest(text))


def test_the_oracle_has_the_gap_of_noise_alone(alpha):
    passage = truth_plant.passage_of(TruthCase(station=alpha, seconds=20_000, inflow=TrueInflow()))
    recording, oracle = passage.recording(truth=True), passage.oracle()
    assert gap(whitened(oracle, recording, alpha.sensors)) == pytest.approx(1.0, abs=0.05)
    np.testing.assert_allclose(oracle.columns["level_m"], recording.truth["truth_level_m"], atol=1e-12)
    assert shrinkage(4.0, 1.0, 1.0) == 1.0
    assert shrinkage(4.0, 4.0, 1.0) == 0.0
    assert shrinkage(1.0, 1.0, 1.0) is None


def test_the_regressor_learns_a_constant_factor():
    rng = np.random.default_rng(1)
    on = np.arange(4000) % 200 > 80
    frequency_hz = 50.0 * on
    flow_m3h = on * (200.0 + 3.0 * rng.standard_normal(4000))

    def recording(values):
        columns = {"level_m": np.ones(4000), "pump1_frequency_hz": frequency_hz, "pump1_flow_m3h": values}
        return Recording(time_ns=NS_PER_S * np.arange(4000), columns=columns)

    said = recording(flow_m3h)
    fixed = corrected(said, recording(1.1 * flow_m3h), said)
    np.testing.assert_allclose(fixed.columns["pump1_flow_m3h"][on], 1.1 * flow_m3h[on], rtol=2e-3)
    sensors = Sensors()
    true = recording(1.1 * flow_m3h)
    assert gap(whitened(fixed, true, sensors)) < 0.1 * gap(whitened(said, true, sensors))
