"""Expected costs and advice, on cases that can be counted by hand."""

import itertools
from typing import get_args

import pytest

from wetwell.detector.verdict.maintenance import advice, expected_costs
from wetwell.protocols.messages.verdict import State
from wetwell.protocols.station.costs import Costs

COSTS = Costs(
    pull_pump=100.0,
    flush_main=200.0,
    check_meter=10.0,
    call_out=1000.0,
    failure_share=0.5,
    energy_per_kwh=0.2,
    horizon_days=10.0,
)


def test_the_costs_of_each_act_by_hand():
    table = expected_costs(
        {"normal": 0.2, "pump_fault": 0.4, "system_fault": 0.2, "pump_and_system_fault": 0.1, "sensor_fault": 0.1},
        50.0,
        COSTS,
    )
    left = 0.5 * 1000.0 + 50.0 * 10.0 * 0.2
    assert table["expected"] == {
        "wait": pytest.approx(0.7 * left + 10.0),
        "pull the pump": pytest.approx(100.0 + 0.3 * left + 10.0),
        "flush the main": pytest.approx(200.0 + 0.5 * left + 10.0),
        "pull the pump and flush the main": pytest.approx(300.0 + 10.0),
        "check the meter": pytest.approx(10.0 + 0.7 * left),
    }
    assert table["cheapest"] == "pull the pump"


@pytest.mark.parametrize(
    ("state", "act"),
    [
        ("normal", "wait"),
        ("pump_fault", "pull the pump"),
        ("system_fault", "flush the main"),
        ("pump_and_system_fault", "pull the pump and flush the main"),
    ],
)
def test_what_is_certain_is_mended(state, act):
    assert expected_costs({state: 1.0}, 10.0, COSTS)["cheapest"] == act


def test_a_meter_that_is_certainly_wrong_is_checked_or_costs_as_much():
    expected = expected_costs({"sensor_fault": 1.0}, 0.0, COSTS)["expected"]
    assert expected["check the meter"] <= min(expected.values())


def test_the_table_goes_from_cheap_to_dear():
    costs = list(expected_costs({"normal": 0.7, "pump_fault": 0.3}, 5.0, COSTS)["expected"].values())
    assert all(a <= b for a, b in itertools.pairwise(costs))


def test_wasted_energy_makes_waiting_dearer_and_saved_energy_does_not_make_it_cheaper():
    def waiting(kwh):
        return expected_costs({"pump_fault": 0.5, "normal": 0.5}, kwh, COSTS)["expected"]["wait"]

    assert waiting(100.0) - waiting(0.0) == pytest.approx(0.5 * 100.0 * 10.0 * 0.2)
    assert waiting(-100.0) == waiting(0.0)


def test_there_is_advice_for_every_state():
    told = {state: advice(state) for state in get_args(State)}
    assert len(set(told.values())) == len(told)
    assert advice("normal", "the flow meter may read +2 %") == "nothing to do (the flow meter may read +2 %)"
