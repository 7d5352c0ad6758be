"""The last verdicts of each pump, and which older ones nobody tells again."""

from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.detector.recent_verdicts import LIVES_UNPROVEN, TOLD_AGAIN, RecentVerdicts


def verdict(pump: int, time_ns: int) -> Verdict:
    return Verdict(
        time=time_ns, station="alpha", pump=pump, state="normal", probability={}, evidence={}, window=(0, time_ns)
    )


def told(recent: RecentVerdicts, *verdicts: Verdict) -> RecentVerdicts:
    for one in verdicts:
        recent.add(one, one.encode())
    return recent


def test_the_last_of_each_pump_are_kept_in_the_order_in_which_they_were_told():
    rare, often = verdict(2, 5), [verdict(1, time_ns) for time_ns in range(TOLD_AGAIN + 3)]
    recent = told(RecentVerdicts(), *often[:5], rare, *often[5:])
    assert recent.payloads() == [one.encode() for one in (often[3], often[4], rare, *often[5:])]
    assert recent.given_up() == {1: [2]}


def test_what_is_told_once_more_takes_no_place():
    first, second = verdict(1, 1), verdict(1, 2)
    assert told(RecentVerdicts(), first, second, first).payloads() == [first.encode(), second.encode()]


def test_nothing_is_given_up_before_there_are_too_many():
    recent = told(RecentVerdicts(), *(verdict(1, time_ns) for time_ns in range(TOLD_AGAIN)))
    assert recent.given_up() == {}


def test_what_is_unproven_of_lives_before_stays_until_it_is_known():
    recent = told(RecentVerdicts({1: [7], 2: [8]}), *(verdict(1, 10 + time_ns) for time_ns in range(TOLD_AGAIN + 1)))
    assert recent.given_up() == {1: [7, 10], 2: [8]}
    recent.unproven[1].remove(7)
    assert recent.given_up() == {1: [10], 2: [8]}


def test_lives_that_nobody_hears_are_remembered_up_to_a_bound():
    times_ns = list(range(LIVES_UNPROVEN))
    recent = told(RecentVerdicts({1: times_ns}), *(verdict(1, 100 + one) for one in range(TOLD_AGAIN + 1)))
    assert recent.given_up() == {1: [*times_ns[1:], 100]}
