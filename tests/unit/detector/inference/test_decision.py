"""From probabilities to the state that is told, and the remark beside it."""

import numpy as np
import pytest

from wetwell.detector.inference.decision import decide
from wetwell.detector.inference.posterior import Posterior

HEAD_M = 25.0


def posterior(probability, *, shift_m=(-2.0, 2.0), tolerance_m=(0.15, 0.5), flow_error=0.0, head_error_m=0.0):
    return Posterior(
        probability=np.array(probability),
        shift_m=np.array(shift_m),
        deviation_m=np.full(2, 0.1),
        tolerance_m=np.array(tolerance_m),
        flow_error=flow_error,
        head_error_m=head_error_m,
        flow_deviation=0.005,
        head_deviation_m=0.1,
    )


def told(probability, **keywords):
    return decide(posterior(probability, **keywords), HEAD_M)


@pytest.mark.parametrize(
    ("probability", "state"),
    [
        ([0.995, 0.005, 0, 0, 0, 0], "normal"),
        ([0.005, 0.995, 0, 0, 0, 0], "pump_fault"),
        ([0.005, 0, 0.995, 0, 0, 0], "system_fault"),
        ([0.005, 0, 0, 0.995, 0, 0], "pump_and_system_fault"),
        ([0.02, 0.98, 0, 0, 0, 0], "unknown"),
        ([0.6, 0.4, 0, 0, 0, 0], "normal"),
        ([0.4, 0.2, 0.2, 0.2, 0, 0], "unknown"),
        ([0.005, 0.75, 0.245, 0, 0, 0], "pump_fault"),
    ],
)
def test_a_fault_is_told_when_it_is_nearly_certain_and_stands_out(probability, state):
    assert told(probability) == (state, None)


def test_two_faults_that_cannot_be_told_apart_are_unknown():
    state, remark = told([0.001, 0.499, 0.5, 0, 0, 0])
    assert state == "unknown"
    assert "cannot be told apart" in remark


@pytest.mark.parametrize("probability", [[0, 1.0, 0, 0, 0, 0], [0, 0, 0, 1.0, 0, 0]])
def test_a_pump_that_gives_more_head_is_not_at_fault(probability):
    state, remark = told(probability, shift_m=(2.0, 0.0))
    assert state == "unknown"
    assert "re-baseline" in remark


def test_a_main_that_takes_less_head_may_have_burst():
    state, remark = told([0, 0, 1.0, 0, 0, 0], shift_m=(0.0, -2.0))
    assert state == "system_fault"
    assert "burst" in remark


@pytest.mark.parametrize(
    ("meters", "errors", "remark"),
    [
        ([0.95, 0.01], {"flow_error": 0.15}, "the flow meter reads +15.0%"),
        ([0.95, 0.01], {"flow_error": -0.041}, "the flow meter reads -4.1%"),
        ([0.01, 0.95], {"head_error_m": -2.5}, "the head sensor reads -10.0%"),
    ],
)
def test_a_wrong_meter_is_told_with_its_error(meters, errors, remark):
    assert told([0.04, 0, 0, 0, *meters], **errors) == ("sensor_fault", remark)


def test_a_meter_that_is_a_little_off_is_told_beside_a_normal_state():
    state, remark = told([0.04, 0, 0, 0, 0.95, 0.01], flow_error=0.02)
    assert (state, remark) == ("normal", "the flow meter may read +2.0%")
    assert told([0.95, 0, 0, 0, 0.05, 0.0], flow_error=0.02) == ("normal", None)


def test_a_meter_is_not_told_wrong_while_its_error_may_be_within_its_tolerance():
    state, remark = told([0.01, 0, 0, 0, 0.99, 0], flow_error=-0.032)
    assert (state, remark) == ("unknown", "the flow meter may read -3.2%"), "65 % beyond, of a deviation of .5 %"


@pytest.mark.parametrize(("normal", "state"), [(0.55, "normal"), (0.2, "unknown")])
def test_a_meter_that_may_be_far_off_is_neither_blamed_nor_passed_over(normal, state):
    assert told([normal, 0.9 - normal, 0, 0, 0.1, 0.0], flow_error=0.2)[0] == state


def test_a_fault_and_a_meter_that_explain_a_run_alike_are_unknown():
    assert told([0.0, 0, 0, 0.5, 0.5, 0], flow_error=0.2)[0] == "unknown"


@pytest.mark.parametrize(
    ("probability", "shift_m", "state"),
    [
        ([0, 0, 1.0, 0, 0, 0], (0.0, 0.45), "normal"),
        ([0, 0, 1.0, 0, 0, 0], (0.0, 0.55), "unknown"),
        ([0, 0, 1.0, 0, 0, 0], (0.0, 0.7), "system_fault"),
        ([0, 1.0, 0, 0, 0, 0], (-0.2, 0.0), "unknown"),
        ([0, 1.0, 0, 0, 0, 0], (-0.4, 0.0), "pump_fault"),
        ([0, 0, 0, 1.0, 0, 0], (-0.4, 0.3), "pump_fault"),
        ([0, 0, 0, 1.0, 0, 0], (-0.1, 0.9), "system_fault"),
        ([0, 0, 0, 1.0, 0, 0], (-0.4, 0.9), "pump_and_system_fault"),
    ],
)
def test_a_shift_that_a_flow_meter_may_make_is_no_fault(probability, shift_m, state):
    told_state, remark = told(probability, shift_m=shift_m)
    assert told_state == state
    assert (remark is not None) is (state in ("normal", "unknown"))


def test_where_the_drawdown_watches_the_meter_no_shift_is_too_small():
    assert told([0, 0, 1.0, 0, 0, 0], shift_m=(0.0, 0.1), tolerance_m=(0.0, 0.0)) == ("system_fault", None)
