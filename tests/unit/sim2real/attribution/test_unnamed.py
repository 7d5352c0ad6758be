"""A correction of a term as a candidate of the search."""

import numpy as np
import pytest

from wetwell.sim2real.attribution.unnamed import _is_named, unnamed
from wetwell.sim2real.correction.bin_covariates import Place
from wetwell.sim2real.correction.dictionary import dictionary
from wetwell.sim2real.correction.selection import Proposal
from wetwell.sim2real.correction.target import Target
from wetwell.simulator.effects.station.correction_part import MOST_SIZE

LOSS = Target(term="head_loss", pump=0, main=2, log_prior=-2.0)


@pytest.fixture
def proposal():
    atoms, _ = dictionary({Place("level_m"): np.linspace(0.5, 1.5, 50)}, np.ones(50, dtype=bool))
    (linear,) = (atom for atom in atoms if atom.shape == "linear")
    return Proposal(target=LOSS, atoms=(linear,), sizes=np.array([0.2, -0.1]), log=30.0)


def test_it_is_the_proposal_at_its_point(proposal):
    candidate, point = unnamed(proposal)
    effect = candidate.effect(point)
    assert (effect.term, effect.main, effect.offset) == ("head_loss", 2, pytest.approx(0.2))
    assert [part.size for part in effect.part] == [pytest.approx(-0.1)]
    assert candidate.effect(candidate.neutral(point)).bounds == pytest.approx((0.0, 0.0))


def test_it_is_as_probable_as_its_term_and_addends(proposal):
    assert unnamed(proposal)[0].log_prior == LOSS.log_prior + proposal.atoms[0].log_prior


@pytest.mark.parametrize(
    ("term", "pump", "named"),
    [
        ("speed", 0, "motor_slip"),
        ("speed", 2, None),
        ("inertia", 0, "water_inertia"),
        ("pump_head", 2, "pump_wear"),
        ("head_reading", 0, "head_sensor_offset"),
        ("level_reading", 0, None),
        ("back_flow", 0, "check_valve_leak"),
        ("back_flow", 1, None),
        ("sump_area", 0, "sump_area_profile"),
    ],
)
def test_a_constant_has_the_name_of_an_effect_of_as_many_pumps(term, pump, named):
    assert Target(term=term, pump=pump, main=0, log_prior=0.0).effect_of_a_constant == named


def test_only_a_constant_is_named(proposal):
    constant = Proposal(target=LOSS, atoms=(), sizes=proposal.sizes[:1], log=30.0)
    assert _is_named(constant, {"friction_bias"})
    assert not _is_named(constant, {"pump_wear"})  # it was left out of the library
    assert not _is_named(proposal, {"friction_bias"})


def test_sizes_stay_in_their_ranges(proposal):
    wild = Proposal(target=LOSS, atoms=proposal.atoms, sizes=np.array([-3.0, 9.0]), log=0.0)
    candidate, point = unnamed(wild)
    np.testing.assert_array_equal(point, [0.0, 1.0])
    assert candidate.free[1].value(1.0) == MOST_SIZE
