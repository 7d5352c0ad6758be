"""Which acts are proposed: by what they tell, what they cost, and what they break."""

import math
from dataclasses import replace

import pytest

from wetwell.protocols.station.costs import Costs
from wetwell.sim2real.attribution.possible import PossibleSet
from wetwell.sim2real.experiments.act import site_of
from wetwell.sim2real.experiments.acts import acts_of
from wetwell.sim2real.experiments.advice import next_experiment
from wetwell.sim2real.experiments.conditions import Conditions
from wetwell.sim2real.experiments.left_open import LeftOpen, left_open
from wetwell.sim2real.experiments.proposals import proposals_of
from wetwell.sim2real.experiments.reported import ProposedAct, proposed_acts
from wetwell.simulator.effects import EFFECTS

CONDITIONS = Conditions(
    inflow_m3h=60.0, signals=("level_m", "flow_m3h", "head_m", "power_kw"), rate_s=1.0, value="instant"
)


def possible(probability, name, **parameters):
    return PossibleSet(effects=(EFFECTS[name](**parameters),), probability=probability, spread=())


ALIKE = (possible(0.55, "pump_wear", head_loss=0.05), possible(0.45, "motor_slip", slip=0.025))
"""Both take as much off the flow at nominal speed."""


@pytest.fixture(scope="module")
def found(alpha):
    return proposals_of(alpha, ALIKE, CONDITIONS)


@pytest.mark.long
def test_wear_is_told_from_slip_where_the_torque_differs_and_not_by_more_of_the_same(found):
    bits = {one.act.name: one.information_bits for one in found.best}
    by_torque = max(bits["pump_1_valve_shut"], bits["pump_1_at_70"])
    assert by_torque > 0.5
    assert by_torque > bits.get("idle_hour", 0.0)
    assert set(found.best[0].separates) <= {("pump_wear",), ("motor_slip",)}


def test_who_is_sure_comes_first_and_the_cheapest_of_them(found):
    resolves = [one.resolves for one in found.best]
    assert resolves == sorted(resolves, reverse=True)
    prices = [one.price for one in found.best if one.resolves]
    assert prices == sorted(prices)
    others = [(round(one.information_bits, 1), -one.price) for one in found.best if not one.resolves]
    assert others == sorted(others, reverse=True)


def test_a_tour_with_rests_does_all_that_a_tour_does_and_more(alpha):
    site = site_of(alpha, set())
    acts = {act.name: act for act in acts_of(site)}
    tour, more = acts["tour_pump_1_to_70"].steps, acts["tour_and_rest_pump_1_to_70"].steps
    assert more[: len(tour)] == tour
    for step in tour:
        pumps = sum(ratio > 0.0 for ratio in step.speed_ratio)
        assert pumps == 0 or step.low_m == (site.low_m if pumps == 1 else site.stop_m)
    assert any(step.longest_s >= 3600.0 and sum(step.speed_ratio) > 0.0 for step in more[len(tour) :])


def test_one_pump_has_no_pair(alpha):
    control = alpha.control.model_copy(update={"out_of_service": (2, 3)})
    site = site_of(alpha.model_copy(update={"control": control}), set())
    (act,) = [act for act in acts_of(site) if act.name == "tour_and_rest_pump_1_to_70"]
    assert all(sum(ratio > 0.0 for ratio in step.speed_ratio) <= 1 for step in act.steps)
    assert "with" not in act.sentence


@pytest.mark.long
def test_two_names_for_the_same_are_told_apart_by_nothing(alpha):
    one = possible(0.5, "friction_bias", factor=1.3)
    same = proposals_of(alpha, (one, replace(one, probability=0.5)), CONDITIONS)
    assert same.best == ()


def test_one_set_needs_no_act(alpha):
    assert proposals_of(alpha, ALIKE[:1], CONDITIONS).best == ()


@pytest.mark.long
def test_the_price_is_that_of_energy_and_work(alpha, found):
    costs = Costs(energy_per_kwh=2.0, crew_per_hour=10.0)
    dear = proposals_of(alpha.model_copy(update={"costs": costs}), ALIKE, CONDITIONS)
    usual = {one.act.name: one for one in found.best}
    for one in dear.best:
        assert one.price == pytest.approx(one.extra_kwh * 2.0 + one.crew_h * 10.0)
        assert one.crew_h == pytest.approx(usual[one.act.name].crew_h)
    at_station = usual["pump_1_valve_shut"]
    assert at_station.crew_h == pytest.approx(2.0 * (at_station.length_h + 1.0))


def test_a_run_that_carries_less_than_comes_in_is_refused_until_less_comes(alpha):
    found = proposals_of(alpha, ALIKE, replace(CONDITIONS, inflow_m3h=190.0))
    reasons = {one.act.name: one.reason for one in found.refused}
    assert reasons["pump_1_at_70"] == "what runs does not carry 190 m³/h: wait until less comes in"
    assert "pumps_1_and_2" not in reasons


@pytest.mark.parametrize(
    ("part", "changes", "act", "reason"),
    [
        ("sump", {"overflow_level_m": 1.7}, "pump_1_at_80", "overflows"),
        ("control", {"max_starts_per_hour": 1}, "pump_1_at_90", "starts 2 times in an hour, 1 are allowed"),
    ],
)
def test_an_act_that_breaks_a_rule_is_refused_with_the_rule(alpha, part, changes, act, reason):
    station = alpha.model_copy(update={part: getattr(alpha, part).model_copy(update=changes)})
    found = proposals_of(station, ALIKE, CONDITIONS)
    assert act not in {one.act.name for one in found.best}
    assert reason in {one.act.name: one.reason for one in found.refused}[act]


def test_pumps_that_are_out_of_service_are_left_alone(alpha):
    control = alpha.control.model_copy(update={"out_of_service": (1,)})
    site = site_of(alpha.model_copy(update={"control": control}), {1, 3})
    assert site.apart == (1, 2)
    for act in acts_of(site):
        assert all(step.speed_ratio is None or step.speed_ratio[0] == 0.0 for step in act.steps)
        assert all(math.isfinite(step.longest_s) for step in act.steps)


def test_what_is_reported_can_be_played(found):
    reported = proposed_acts(found)[0]
    again = ProposedAct.model_validate_json(reported.model_dump_json())
    for step, ordered in zip(found.best[0].act.steps, again.steps, strict=True):
        assert ordered.step.low_m == pytest.approx(step.low_m)
        assert ordered.step == replace(step, low_m=ordered.step.low_m, high_m=ordered.step.high_m)


def test_what_is_left_open_survives_a_file(alpha):
    left = left_open(alpha, CONDITIONS, ALIKE)
    read = LeftOpen.model_validate_json(left.model_dump_json(by_alias=True))
    assert read.station == alpha
    assert read.conditions == CONDITIONS
    assert tuple(one.possible for one in read.sets) == ALIKE


def test_advice_names_what_is_told_apart(found):
    told = next_experiment("effect", found.best, ("pump",))
    assert told.startswith(found.best[0].act.sentence)
    suspects = ("rising_main", "flow_meter")
    assert "inspect the rising main or the flow meter" in next_experiment("unknown", found.best, suspects)
    assert "Nothing to explain" in next_experiment("none", (), ("station",))
