"""The watch over days of another plant whose main gets rougher and is flushed: named, dated, told once, and over."""

from dataclasses import replace

import pytest

from wetwell.protocols.timestamps import NS_PER_DAY, NS_PER_S
from wetwell.services.stations import find_station
from wetwell.sim2real.truth.case import START_NS, TruthCase, TruthFault
from wetwell.sim2real.truth.truth_plant import run
from wetwell.sim2real.watch.agreement import ToldFault
from wetwell.sim2real.watch.state import WatchState
from wetwell.sim2real.watch.watching import watched

pytestmark = [pytest.mark.check, pytest.mark.long]

ALPHA = find_station("alpha")
CHANGE_S = 36_000
LATE_S = 76_000
"""Times of the day at which the main changes. [s]"""
CHANGED_NS = START_NS + NS_PER_DAY + CHANGE_S * NS_PER_S


def day_of(number, change_s=None):
    """A day of the fine plant; from `change_s` on its main has a tenth more friction."""
    faults = (
        () if change_s is None else (TruthFault(kind="clogging", start_s=change_s, end_s=change_s + 1.0, size=0.1),)
    )
    case = TruthCase(station=ALPHA, faults=faults, seed=983_000 + number, start_ns=START_NS + number * NS_PER_DAY)
    return replace(run(case, truth=False), station=None)


@pytest.fixture(scope="module")
def days():
    return [day_of(0), day_of(1, CHANGE_S), day_of(2, 0.0), day_of(3)]


@pytest.fixture(scope="module")
def states(days):
    state, found = WatchState(station=ALPHA), []
    for day in days:
        state = watched(state, day)
        found.append(state)
    return found


def test_a_station_without_a_gap_is_called_nothing(states):
    assert states[0].called == ()
    assert not states[0].is_doubled
    assert max(states[0].looks[0].gap.values()) < 1.1


def test_a_rougher_main_is_named_on_the_day_and_dated_within_half_an_hour(states):
    (one,) = states[1].called
    assert one.name == "friction_bias"
    low, high = one.effect.parameters["factor"].ci
    assert low < 1.1 < high
    assert one.since_ns == pytest.approx(CHANGED_NS, abs=1800 * NS_PER_S)


def test_the_gap_that_matters_has_doubled_and_stays_so_under_one_name(states):
    assert states[1].is_doubled
    assert states[2].is_doubled
    assert [one.name for one in states[2].called] == ["friction_bias"]
    assert states[2].looks[-1].matters > 2.0


def test_what_is_flushed_is_over(states, days):
    (past,) = states[3].past
    assert past.called.name == "friction_bias"
    assert past.ended_ns == pytest.approx(days[3].time_ns[0], abs=3600 * NS_PER_S)
    assert states[3].called == ()


def test_a_kept_state_goes_on_as_one_that_never_ended(states, days):
    read = WatchState.model_validate_json(states[1].model_dump_json())
    assert watched(read, days[2]) == states[2]


def test_a_fault_that_the_detector_tells_is_said_once(states, days):
    fault = ToldFault(asset="main", since_ns=CHANGED_NS)
    state = watched(states[0], days[1], [fault])
    (one,) = state.called
    assert one.fault == "main"
    assert not state.is_doubled
    assert state.believed(only_faults=True) == state.believed()
    assert state.looks[-1].gap["flow"] < states[1].looks[-1].gap["flow"]
    assert watched(state, days[2]).looks[-1].gap["flow"] < 1.5 < states[2].looks[-1].gap["flow"]


def test_a_fault_of_another_asset_leaves_the_gap_what_it_is(states, days):
    fault = ToldFault(asset="pump:1", since_ns=int(days[0].time_ns[0]))
    state = watched(states[0], days[1], [fault])
    assert state.called[0].fault is None
    assert state.is_doubled


def test_no_diagnosis_without_a_change(states, days):
    def refuse(*_):
        raise AssertionError("nothing has changed")

    assert watched(states[1], days[2], diagnosed=refuse).called == states[1].called


def test_a_change_late_in_the_day_is_named_by_the_next_one(states, days):
    calls = []
    second = watched(states[0], day_of(1, LATE_S), diagnosed=lambda *given: calls.append(given))
    assert (second.called, calls) == ((), [])
    assert [one.name for one in watched(second, days[2]).called] == ["friction_bias"]
