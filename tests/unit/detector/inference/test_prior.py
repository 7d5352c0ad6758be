"""What one run leaves behind for the next, on the same pump and on its siblings."""

import numpy as np
import pytest

from wetwell.detector.inference.posterior import BOTH, FLOW_METER, HEAD_SENSOR, NORMAL, PUMP_FAULT, SYSTEM_FAULT
from wetwell.detector.inference.prior import (
    FLOW_METER_PRIOR,
    HEAD_SENSOR_PRIOR,
    PUMP_PRIOR,
    SYSTEM_PRIOR,
    PumpPrior,
    SystemPrior,
    joint_prior,
    kept_shares,
    update_prior,
)

HYPOTHESES = range(6)


def certain(hypothesis):
    return np.eye(6)[hypothesis]


def test_the_first_prior_is_that_of_its_parts():
    prior = joint_prior(PumpPrior(), SystemPrior())
    assert prior.sum() == pytest.approx(1.0)
    assert prior[PUMP_FAULT] + prior[BOTH] == pytest.approx(PUMP_PRIOR, rel=0.03)
    assert prior[SYSTEM_FAULT] + prior[BOTH] == pytest.approx(SYSTEM_PRIOR, rel=0.03)
    assert prior[BOTH] == pytest.approx(PUMP_PRIOR * SYSTEM_PRIOR, rel=0.03)
    assert prior[FLOW_METER] == pytest.approx(FLOW_METER_PRIOR, rel=0.12)
    assert prior[HEAD_SENSOR] == pytest.approx(HEAD_SENSOR_PRIOR, rel=0.12)


def test_what_the_main_does_to_one_pump_is_expected_of_the_next():
    first, second, system = PumpPrior(), PumpPrior(), SystemPrior()
    before = joint_prior(second, system)
    update_prior(certain(SYSTEM_FAULT), first, system)
    after = joint_prior(second, system)
    assert after[SYSTEM_FAULT] > 0.85
    assert before[SYSTEM_FAULT] < 0.06
    assert after[PUMP_FAULT] + after[BOTH] == pytest.approx(PUMP_PRIOR, abs=0.01)


@pytest.mark.parametrize("hypothesis", [PUMP_FAULT, FLOW_METER, HEAD_SENSOR])
def test_what_is_wrong_with_one_pump_says_nothing_of_the_next(hypothesis):
    first, second, system = PumpPrior(), PumpPrior(), SystemPrior()
    before = joint_prior(second, system)
    update_prior(certain(hypothesis), first, system)
    after = joint_prior(second, system)
    assert joint_prior(first, system)[hypothesis] > 0.85
    np.testing.assert_allclose(after, before, atol=0.06)
    assert after[hypothesis] >= before[hypothesis]


@pytest.mark.parametrize("hypothesis", HYPOTHESES)
def test_nothing_is_ever_certain_and_healthy_runs_clear_it(hypothesis):
    pump, system = PumpPrior(), SystemPrior()
    for _ in range(100):
        update_prior(certain(hypothesis), pump, system)
    prior = joint_prior(pump, system)
    assert prior.sum() == pytest.approx(1.0)
    assert prior[hypothesis] > 0.8
    assert prior.min() > 1e-7
    update_prior(certain(NORMAL), pump, system)
    assert joint_prior(pump, system)[NORMAL] > 0.99


def test_a_sibling_that_meets_a_healthy_main_clears_the_suspicion_of_it():
    first, second, system = PumpPrior(), PumpPrior(), SystemPrior()
    update_prior(certain(BOTH), first, system)
    update_prior(certain(NORMAL), second, system)
    prior = joint_prior(first, system)
    assert prior[PUMP_FAULT] > 0.8
    assert prior[BOTH] < 0.02


def test_what_a_pump_has_told_of_the_main_is_not_forgotten_as_its_sibling_runs_on():
    """Each run shows that pump or main is at fault, and no more; the first told that it is the main."""
    pumps, system = [PumpPrior(), PumpPrior()], SystemPrior()
    for number in range(2000):
        pump, sibling = pumps[number % 2], pumps[1 - number % 2]
        probability = joint_prior(pump, system)
        probability[[NORMAL, FLOW_METER, HEAD_SENSOR]] = 0.0
        probability /= probability.sum()
        update_prior(probability, pump, system, lacks_head=True, siblings=[sibling])
    assert probability[SYSTEM_FAULT] > 0.85, "both pumps would have to have a fault of their own: 20 to 1"


def test_what_has_begun_since_the_last_run_is_no_fault_that_was_there_before():
    pump, system = PumpPrior(), SystemPrior()
    update_prior(certain(NORMAL), pump, system, lacks_head=True)
    np.testing.assert_allclose(kept_shares(pump, system)[[PUMP_FAULT, SYSTEM_FAULT, BOTH]], 0.0, atol=1e-12)
    update_prior(certain(SYSTEM_FAULT), pump, system, lacks_head=True)
    shares = kept_shares(pump, system)
    assert shares[SYSTEM_FAULT] > 0.9
    np.testing.assert_allclose(shares[[PUMP_FAULT, BOTH]], 0.0, atol=1e-12)
