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
