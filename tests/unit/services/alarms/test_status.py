"""States of an alarm, its delays, and how often alarms call."""

import pytest

from wetwell.protocols.messages.alarm import AlarmAct
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.alarms.delay import Delay
from wetwell.services.alarms.rates import AlarmRates
from wetwell.services.alarms.rules import RULES, changed_rules, parse_alarm_id
from wetwell.services.alarms.status import ActRefusedError, AlarmStatus, is_shelf_over, with_act, with_condition

STATES = {
    "normal": AlarmStatus(),
    "unacknowledged": AlarmStatus("unacknowledged", is_active=True, raised_ns=1),
    "acknowledged": AlarmStatus("acknowledged", is_active=True, raised_ns=1, acknowledged_ns=2, by="ann"),
    "returned": AlarmStatus("returned", raised_ns=1, returned_ns=2),
    "shelved": AlarmStatus("shelved", is_active=True, raised_ns=1, until_ns=60, by="ann"),
    "out_of_service": AlarmStatus("out_of_service", is_active=True, raised_ns=1, by="ann"),
}
AFTER = {  # ISA-18.2; what is not there is refused
    ("unacknowledged", "acknowledge"): "acknowledged",
    ("returned", "acknowledge"): "normal",
    ("normal", "shelve"): "shelved",
    ("unacknowledged", "shelve"): "shelved",
    ("acknowledged", "shelve"): "shelved",
    ("returned", "shelve"): "shelved",
    ("shelved", "shelve"): "shelved",
    ("shelved", "unshelve"): "unacknowledged",
    ("shelved", "out_of_service"): "out_of_service",
    ("normal", "out_of_service"): "out_of_service",
    ("unacknowledged", "out_of_service"): "out_of_service",
    ("acknowledged", "out_of_service"): "out_of_service",
    ("returned", "out_of_service"): "out_of_service",
    ("out_of_service", "in_service"): "unacknowledged",
}
ACTS = ("acknowledge", "shelve", "unshelve", "out_of_service", "in_service")


def act(name: str, **fields) -> AlarmAct:
    minutes = 10.0 if name == "shelve" else None
    base = {"id": "1", "station": "alpha", "alarm": "level_high", "act": name, "by": "bob", "minutes": minutes}
    return AlarmAct.model_validate(base | fields)


@pytest.mark.parametrize("name", ACTS)
@pytest.mark.parametrize("state", STATES)
def test_an_act_leads_where_the_standard_says_or_is_refused(state, name):
    expected = AFTER.get((state, name))
    if expected is None:
        with pytest.raises(ActRefusedError, match=f"{name}: the alarm is {state}"):
            with_act(STATES[state], act(name), 5, 7)
    else:
        after = with_act(STATES[state], act(name), 5, 7)
        assert (after.state, after.by) == (expected, "bob")
        assert after.is_active == STATES[state].is_active
        assert (after.until_ns is not None) == (expected == "shelved")


@pytest.mark.parametrize(
    ("state", "is_active", "expected"),
    [
        ("normal", True, "unacknowledged"),
        ("returned", True, "unacknowledged"),
        ("unacknowledged", False, "returned"),
        ("acknowledged", False, "normal"),
        ("shelved", False, "shelved"),
        ("out_of_service", False, "out_of_service"),
        ("unacknowledged", True, "unacknowledged"),
        ("acknowledged", True, "acknowledged"),
        ("normal", False, "normal"),
    ],
)
def test_a_condition_that_comes_or_goes_leads_where_the_standard_says(state, is_active, expected):
    after = with_condition(STATES[state], is_active=is_active, time_ns=9)
    assert (after.state, after.is_active) == (expected, is_active)


def test_a_raise_forgets_who_acknowledged_the_last_one_and_a_shelf_has_an_end():
    back = with_condition(STATES["acknowledged"], is_active=False, time_ns=3)
    again = with_condition(back, is_active=True, time_ns=4)
    assert (again.acknowledged_ns, again.by, again.raised_ns, again.returned_ns) == (None, None, 4, None)
    shelved = with_act(again, act("shelve", minutes=2.0), 1_000, 5)
    assert not is_shelf_over(shelved, 1_000 + 120 * NS_PER_S - 1)
    assert is_shelf_over(shelved, 1_000 + 120 * NS_PER_S)


def test_a_delay_starts_anew_when_the_condition_goes_and_no_clock_can_use_it_up():
    delay = Delay()
    looks = [(True, 0), (True, 50), (False, 51), (True, 52), (True, 111), (True, 112)]
    assert [delay.update(wanted, at * NS_PER_S, 60.0, 0.0) for wanted, at in looks] == [False] * 5 + [True]
    delay = Delay()
    looks = [(True, 0), (True, 3600), (True, 0), (True, 61)]  # the clock is set by an hour and back
    assert [delay.update(wanted, at * NS_PER_S, 120.0, 0.0) for wanted, at in looks] == [False, False, False, True]
    assert [delay.update(False, at * NS_PER_S, 0.0, 5.0) for at in (62, 66, 67)] == [True, True, False]


def test_the_same_seconds_count_once_and_a_clock_that_is_set_back_is_followed():
    delay = Delay()
    looks = [(True, 0), (True, 10), (True, 1), (True, 10), (True, 11), (True, 2), (True, 20), (True, 21)]
    assert [delay.update(wanted, at * NS_PER_S, 21.0, 0.0) for wanted, at in looks] == [False] * 7 + [True]
    delay = Delay()
    looks = [(True, 1_000), (True, 1_010), (True, 900), (True, 910), (True, 911)]
    assert [delay.update(wanted, at * NS_PER_S, 21.0, 0.0) for wanted, at in looks] == [False] * 4 + [True]
    delay = Delay()
    looks = [(True, 50), (True, 60), (False, 60), (True, 20), (True, 29), (True, 30)]  # begins where it is seen anew
    assert [delay.update(wanted, at * NS_PER_S, 10.5, 0.0) for wanted, at in looks] == [False] * 6
    assert delay.update(True, 31 * NS_PER_S, 10.5, 0.0)


def test_a_flood_begins_above_ten_calls_in_ten_minutes_and_ends_below_five():
    rates = AlarmRates()
    for second in range(10):
        rates.add(second * NS_PER_S)
        assert not rates.look(second * NS_PER_S)
    rates.add(10 * NS_PER_S)
    assert rates.look(10 * NS_PER_S)
    assert not rates.look(605 * NS_PER_S)  # five are left
    assert rates.is_flood
    assert rates.look(606 * NS_PER_S)
    figures = rates.figures(3_700 * NS_PER_S)
    assert (figures["alarms_10min"], figures["alarms_hour"], figures["alarms_day"]) == (0.0, 0.0, 11.0)
    assert (figures["peak_10min"], figures["flood_share"], figures["is_flood"]) == (11.0, 1 / 144, 0.0)
    assert rates.figures(90_000 * NS_PER_S)["alarms_day"] == 0.0


def test_the_rule_table_can_be_changed_by_name_and_names_are_checked():
    rules = changed_rules({"pump_fault": {"priority": "low", "on_delay_s": 600.0}})
    assert (rules["pump_fault"].priority, rules["pump_fault"].on_delay_s) == ("low", 600.0)
    assert rules["level_high"] == RULES["level_high"]
    for wrong in ("pump_fault", "pump2.level_high", "pump0.pump_fault", "pump33.pump_fault", "x.pump_fault", ""):
        with pytest.raises(ValueError, match="is none of"):
            parse_alarm_id(wrong)
