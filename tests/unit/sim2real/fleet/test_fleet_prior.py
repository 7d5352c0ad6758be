"""A prior from other stations: it holds a further one, few stations say little, nobody is a witness of its own."""

import numpy as np
import pytest

from wetwell.sim2real.diagnosis.report import FittedParameter, FoundEffect
from wetwell.sim2real.fleet.fleet_prior import ADDED, Finding, FleetPrior, fleet_prior


def finding(number, value=None, error=0.01, name="friction_bias", parameter="factor"):
    if value is None:
        return Finding(station=f"s{number}", effects=())
    ends = (value - 1.96 * error, value + 1.96 * error)
    effect = FoundEffect(
        name=name,
        component="rising_main",
        equivalent=(),
        parameters={parameter: FittedParameter(value=float(value), ci=ends, unit="1")},
    )
    return Finding(station=f"s{number}", effects=(effect,))


@pytest.mark.parametrize(("count", "spread"), [(3, 0.0), (3, 0.05), (8, 0.02), (19, 0.0), (19, 0.05)])
def test_the_prior_holds_a_further_station_at_least_as_often_as_it_says(count, spread):
    """95 % of 400 fleets, with fits that are off by their errors of 1 to 3 %; wide is allowed, narrow is not."""
    rng = np.random.default_rng(19)
    held, fleets = 0, 400
    for _ in range(fleets):
        true = rng.normal(1.2, spread, count + 1)
        errors = rng.uniform(0.01, 0.03, count)
        findings = [finding(k, rng.normal(true[k], errors[k]), errors[k]) for k in range(count)]
        told = fleet_prior(findings).parameters["friction_bias"]["factor"]
        held += abs(true[-1] - told.mean) <= 1.96 * told.sd
    assert held / fleets > 0.95 - 3.0 * (0.95 * 0.05 / fleets) ** 0.5


def test_twenty_that_are_alike_say_more_than_one_of_them():
    rng = np.random.default_rng(7)
    told = fleet_prior([finding(k, rng.normal(1.2, 0.02), 0.02) for k in range(19)])
    assert told.parameters["friction_bias"]["factor"].sd < 0.02
    assert told.parameters["friction_bias"]["factor"].mean == pytest.approx(1.2, abs=0.02)


def test_stations_that_differ_say_how_much():
    rng = np.random.default_rng(8)
    told = fleet_prior([finding(k, rng.normal(1.2, 0.2), 0.01) for k in range(40)])
    assert told.parameters["friction_bias"]["factor"].sd == pytest.approx(0.2, rel=0.4)


def test_two_stations_say_nothing_of_sizes():
    assert fleet_prior([finding(1, 1.2), finding(2, 1.2)]).parameters == {}


def test_usual_effects_weigh_more_and_none_is_impossible():
    prior = fleet_prior([finding(k, 1.2) for k in range(9)] + [finding(9)])
    usual, rare = prior.effects["friction_bias"], prior.effects["ragging"]
    assert (usual.stations, rare.stations) == (9, 0)
    assert usual.weight / rare.weight == pytest.approx((9 + ADDED) / ADDED)
    assert np.mean([one.weight for one in prior.effects.values()]) == pytest.approx(1.0, abs=1e-4)


def test_a_station_is_no_witness_of_its_own():
    findings = [finding(k, 1.2) for k in range(4)]
    assert fleet_prior(findings, without="s3") == fleet_prior(findings[:3])


def test_without_stations_all_is_even():
    priors = fleet_prior([]).priors
    names = tuple(fleet_prior([]).effects)
    assert priors.parameters == {}
    for sets in ((names[0],), names[:2]):
        assert priors.log_share(sets, names) == pytest.approx(-np.log(len(names)))


def test_it_is_read_back_as_it_was_written():
    prior = fleet_prior([finding(k, 1.2) for k in range(5)])
    assert FleetPrior.model_validate_json(prior.model_dump_json(by_alias=True)) == prior
