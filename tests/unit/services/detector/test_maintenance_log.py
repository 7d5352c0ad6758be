"""Acts of maintenance: entered once, checked by the runs that follow."""

import pytest

from wetwell.protocols.messages.maintenance import MaintenanceAct
from wetwell.protocols.messages.verdict import AssetFault, Severity, Verdict
from wetwell.services.detector.maintenance_log import MaintenanceLog


def friction(value):
    return Severity(quantity="friction_rise_percent", value=value, interval=(value - 1.0, value + 1.0), limit=15.0)


class Judge:
    """A detector whose severities the test sets."""

    def __init__(self):
        self.seen_until_ns = 100
        self.severities = {"main": friction(20.0), "pump:2": friction(9.0)}
        self.anew = []

    def severity(self, asset):
        return self.severities.get(asset)

    def pumps_of(self, asset):
        return {"main": [0, 1, 2], "pump:2": [1], "sensor:pump2_flow_m3h": [1], "sensor:level_m": [0, 1, 2]}.get(
            asset, []
        )

    def rebaseline(self, pump, now_ns):
        self.anew.append(pump)
        return verdict(now_ns, pump + 1)


def verdict(time, pump=2, *faults):
    fields = {
        "time": time,
        "station": "s",
        "pump": pump,
        "state": "normal",
        "probability": {},
        "window": (time, time),
    }
    return Verdict.model_validate(fields | {"evidence": {"shift_m": {}}, "faults": faults})


def act(asset="main", what="flushed", at=None, name="one"):
    fields = {"id": name, "station": "s", "asset": asset, "act": what, "found": "deposits", "by": "ann"}
    return MaintenanceAct.model_validate(fields | {"time": at})


@pytest.fixture
def judge():
    return Judge()


@pytest.fixture
def told():
    return []


@pytest.fixture
def log(judge, told):
    return MaintenanceLog("s", judge, told.append)


@pytest.mark.parametrize(("after", "result"), [(0.5, "back"), (12.0, "better"), (19.5, "no change")])
def test_an_act_is_judged_after_four_runs_of_its_asset(log, judge, told, after, result):
    assert log.enter(act()) == []
    judge.severities["main"] = friction(after)
    for number in range(4):
        assert [record.result for record in told] == ["pending"]
        log.follow(verdict(200 + number, pump=1 + number % 3))
    assert (told[-1].result, told[-1].before, told[-1].after) == (result, friction(20.0), friction(after))
    assert told[-1].time == 100, "without a time it was done just now"
    log.follow(verdict(300))
    assert len(told) == 2


def test_runs_of_other_assets_and_from_before_the_act_say_nothing(log, told):
    log.enter(act("pump:2", "pulled", at=500))
    for number in range(10):
        log.follow(verdict(400 + number))
        log.follow(verdict(600 + number, pump=1))
    assert [record.result for record in told] == ["pending"]


@pytest.mark.parametrize(
    ("asset", "what", "pumps"),
    [
        ("sensor:pump2_flow_m3h", "calibrated", [1]),
        ("pump:2", "Impeller replaced", [1]),
        ("pump:2", "pulled", []),
        ("main", "valve replaced", []),
        ("sensor:level_m", "calibrated", []),
    ],
)
def test_what_is_another_one_now_is_learnt_anew(log, judge, told, asset, what, pumps):
    verdicts = log.enter(act(asset, what))
    assert (judge.anew, [one.pump - 1 for one in verdicts]) == (pumps, pumps)
    assert told[-1].result == ("learning anew" if pumps else "pending")


def test_a_meter_is_judged_by_whether_its_fault_still_stands(log, told):
    fault = AssetFault(asset="sensor:level_m", stage="plan", since=5)
    log.follow(verdict(90, 2, fault))
    log.enter(act("sensor:level_m", "cleaned", name="one"))
    for number in range(4):
        log.follow(verdict(200 + number, 2, fault))
    assert told[-1].result == "no change"
    log.enter(act("sensor:level_m", "cleaned", at=300, name="two"))
    for number in range(4):
        log.follow(verdict(300 + number))
    assert (told[-1].id, told[-1].result) == ("two", "back")


def test_an_act_that_comes_again_is_answered_and_not_entered_again(log, judge, told):
    log.enter(act("sensor:pump2_flow_m3h", "calibrated"))
    log.enter(act("sensor:pump2_flow_m3h", "calibrated"))
    assert judge.anew == [1]
    assert told[0] == told[1]


def test_an_asset_that_is_not_there_is_refused_and_not_kept(log, told):
    log.enter(act("pump:7"))
    assert told[-1].refused == "asset: got 'pump:7', station 's' has none of that name"
    assert not log.records


def test_a_log_goes_on_after_a_restart(log, judge, told):
    log.enter(act())
    again = MaintenanceLog("s", judge, told.append, log.records.values())
    judge.severities["main"] = friction(0.0)
    for number in range(4):
        again.follow(verdict(200 + number))
    assert told[-1].result == "back"
