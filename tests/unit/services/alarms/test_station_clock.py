"""The clock of a station: late samples do not set it back, a clock that was set back does, and it runs on."""

import pytest

from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.alarms.station_clock import Now, set_by, went_on


def at(steady_s):
    return Now(round(1e6 * NS_PER_S + steady_s * NS_PER_S), steady_s)


def after(*samples):
    """The clock after samples, each the time at which it came and its own. [s]"""
    (came_s, time_s), *later = samples
    clock = set_by(time_s * NS_PER_S, at(came_s))
    for came_s, time_s in later:
        clock = clock.after(time_s * NS_PER_S, at(came_s))
    return clock


def says_s(clock, steady_s):
    return clock.now_ns(at(steady_s)) / NS_PER_S


def test_it_runs_on_at_the_pace_of_the_wall():
    assert says_s(after((0, 100), (10, 110)), 17) == 117


def test_samples_that_come_late_do_not_set_it_back():
    late = [(5000, time_s) for time_s in range(110, 4000, 10)]
    assert says_s(after((0, 100), *late), 5000) == 5100


def test_samples_of_a_clock_that_was_set_back_set_it_back():
    set_back = [(come_s, come_s - 3500) for come_s in (10, 20, 30)]
    assert says_s(after((0, 100), *set_back), 30) == -3470


@pytest.mark.parametrize("pace", [0.5, 1.0, 600.0])
def test_it_follows_a_plant_of_any_pace(pace):
    clock = after(*[(second, round(pace * second)) for second in range(0, 100, 2)])
    assert says_s(clock, 98) == pytest.approx(98 * pace, abs=2)


def test_a_plant_that_stood_does_not_stay_behind():
    stood = [(5000 + second, 101 + second) for second in range(5)]
    assert says_s(after((0, 100), *stood), 5004) == 105


@pytest.mark.parametrize(("ahead_s", "wanted_s"), [(200, 1e6 + 250), (None, 1e6), (-1000, 1e6)])
def test_it_ran_on_while_nobody_looked(ahead_s, wanted_s):
    ahead_ns = None if ahead_s is None else ahead_s * NS_PER_S
    assert says_s(went_on(round(1e6 * NS_PER_S), ahead_ns, at(50)), 50) == wanted_s
