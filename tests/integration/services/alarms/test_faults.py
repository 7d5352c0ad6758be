"""Alarms of faults with a stage: one a cause, as urgent as the stage, none where the mode of the station says so."""

import json

import pytest
from alarm_site import START_NS, Site

from wetwell.protocols.messages.verdict import AssetFault, Severity, Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.alarms.state_file import SiteState


def fault(stage, value=9.0, asset="main"):
    severity = Severity(
        quantity="friction_rise_percent", value=value, interval=(value - 1.0, value + 1.0), limit=15.0
    )
    return AssetFault(asset=asset, stage=stage, since=START_NS, severity=severity, advice="flush it")


class Station(Site):
    """A site whose verdicts tell what stands."""

    def stands(self, at_s, *faults, pump=2, **evidence):
        time_ns = START_NS + at_s * NS_PER_S
        fields = {"time": time_ns, "station": "alpha", "pump": pump, "window": (time_ns, time_ns)}
        state = "system_fault" if faults else "normal"
        told = {"state": state, "probability": {state: 1.0}, "evidence": evidence, "faults": faults}
        self.service.handle_verdict(Verdict.model_validate(fields | told).encode())
        return self.news()

    def calls(self):
        return len(self.service.registry.rates.calls_ns)


def test_what_three_pumps_see_of_one_main_is_one_alarm():
    site = Station()
    assert site.stands(10, fault("act"), pump=1) == [("main.system_fault", "unacknowledged")]
    assert site.stands(20, fault("act"), pump=2) == site.stands(30, fault("act"), pump=3) == []
    assert (site.calls(), len(site.service.registry.records)) == (1, 1)
    assert site.stands(40, pump=3) == [("main.system_fault", "returned")]


def test_the_mains_of_a_station_have_an_alarm_each_and_do_not_clear_each_other():
    site = Station()
    assert site.stands(10, fault("act", asset="main:north/1"), pump=1, main="north/1") == [
        ("main:north%2F1.system_fault", "unacknowledged")
    ]
    assert site.stands(20, pump=2, main="south") == []
    assert site.act("acknowledge", alarm="main:north%2F1.system_fault").is_done
    assert site.news() == [("main:north%2F1.system_fault", "acknowledged")]


def test_to_watch_calls_nobody_and_each_stage_more_urgent_calls_once():
    site = Station()
    assert site.stands(10, fault("watch", 2.0)) == [("main.system_fault", "acknowledged")]
    (alarm,) = site.told
    assert (alarm.priority, alarm.stage, alarm.asset, alarm.acknowledged) == ("advisory", "watch", "main", None)
    assert site.calls() == 0
    assert site.stands(20, fault("plan", 8.0)) == [("main.system_fault", "unacknowledged")]
    assert (site.told[0].priority, site.told[0].raised) == ("low", START_NS + 10 * NS_PER_S)
    assert site.act("acknowledge", alarm="main.system_fault").is_done
    site.news()
    assert site.stands(30, fault("plan", 8.4)) == []
    assert site.stands(40, fault("act", 17.0)) == [("main.system_fault", "unacknowledged")]
    assert site.told[0].priority == "high"
    assert site.stands(50, fault("plan", 13.0)) == [("main.system_fault", "unacknowledged")]
    assert site.calls() == 2
    assert site.stands(60) == [("main.system_fault", "returned")]


def test_the_text_follows_the_verdict_when_it_has_news():
    site = Station()
    site.stands(10, fault("plan", 9.0))
    assert site.told[0].text == "main: plan, friction 9 % (8 to 10), limit 15 %"
    assert site.stands(20, fault("plan", 9.9)) == []
    assert site.stands(30, fault("plan", 10.6)) == [("main.system_fault", "unacknowledged")]
    assert site.told[0].severity.value == 10.6
    assert "friction 11 % (9.6 to 12)" in site.told[0].text
    site.wall_s = 40.0
    site.act("acknowledge", alarm="main.system_fault")
    site.news()
    assert site.stands(30 + 86_400, fault("plan", 10.6)) == [], "since the acknowledgement no day has passed"
    assert site.stands(41 + 86_400, fault("plan", 10.7)) == [("main.system_fault", "acknowledged")]


def test_raised_and_acknowledged_are_in_the_time_of_the_station():
    site = Station()
    site.sample(at_s=1_000.0)
    site.stands(1_000, fault("act"))
    site.wall_s = 5.0
    alarm = site.act("acknowledge", alarm="main.system_fault").alarm
    assert (alarm.raised, alarm.acknowledged) == (START_NS + 1_000 * NS_PER_S, START_NS + 1_005 * NS_PER_S)


def test_a_latched_alarm_stays_until_it_is_acknowledged_and_reset():
    site = Station(rules={"system_fault": {"is_latching": True}})
    site.stands(10, fault("act"))
    assert site.stands(20) == [("main.system_fault", "latched_unacknowledged")]
    assert site.act("reset", alarm="main.system_fault").reason == "reset: the alarm is latched_unacknowledged"
    site.wall_s = 1.0
    assert site.act("acknowledge", alarm="main.system_fault").alarm.state == "latched_acknowledged"
    site.wall_s = 2.0
    assert site.act("reset", alarm="main.system_fault").alarm.state == "normal"
    site.news()
    assert site.stands(30, fault("act")) == [("main.system_fault", "unacknowledged")]
    site.wall_s = 3.0
    site.act("acknowledge", alarm="main.system_fault")
    site.news()
    assert site.stands(40) == [("main.system_fault", "latched_acknowledged")]
    assert site.stands(50, fault("act")) == [("main.system_fault", "unacknowledged")]


def test_a_station_under_maintenance_calls_nobody_by_what_the_crew_does(tmp_path):
    site = Station(folder=tmp_path)
    site.stands(10, fault("act"))
    assert site.act("maintenance", alarm="station", reason="pumps are pulled").is_done
    assert site.news() == [("station", "suppressed"), ("main.system_fault", "suppressed")]
    assert [told.reason for told in site.told] == ["pumps are pulled"] * 2
    assert site.stands(20, fault("act"), fault("act", asset="pump:2")) == [("pump2.pump_fault", "suppressed")]
    assert site.calls() == 1
    site.service.save()
    site.start()
    assert site.stands(30, fault("act"), fault("act", asset="pump:2")) == [], "also after a restart"
    site.wall_s = 1.0
    assert site.act("maintenance", alarm="station").reason == "maintenance: the station is maintenance"
    site.wall_s = 2.0
    assert site.act("resume", alarm="station").is_done
    faults = [("main.system_fault", "unacknowledged"), ("pump2.pump_fault", "unacknowledged")]
    assert sorted(site.news()) == [*faults, ("station", "normal")]
    audit = (tmp_path / "alarm-audit.jsonl").read_text()
    assert audit.count('"alarm": "station"') == 3


def test_that_a_station_is_under_maintenance_is_told_even_where_nothing_else_is_and_after_a_restart(tmp_path):
    site = Station(folder=tmp_path)
    site.sample()
    site.news()
    site.act("maintenance", alarm="station", reason="pumps are pulled")
    assert site.news() == [("station", "suppressed")]
    site.start()
    (told,) = site.service.registry.alarms()
    assert (told.text, told.reason, told.state) == ("under maintenance", "pumps are pulled", "suppressed")
    site.wall_s = 1.0
    assert site.act("resume", alarm="station").is_done
    assert site.news() == [("station", "normal")]


def test_a_stopped_station_may_be_silent_but_not_flood():
    site = Station(stale_after_s=30.0)
    site.sample()
    site.act("stop", alarm="station")
    assert site.look(60.0) == [("station", "suppressed"), ("samples_stale", "suppressed")]
    assert site.calls() == 0
    registry, at_ns = site.service.registry, START_NS + 100 * NS_PER_S
    for second in range(12):
        registry.observe("alpha", "overflow_risk", True, at_ns + second * NS_PER_S, at_ns)
    assert ("overflow_risk", "unacknowledged") in site.news()


@pytest.mark.parametrize("rule", ["system_fault", "pump_and_system_fault", "sensor_fault"])
def test_alarms_of_an_older_version_are_read_and_cleared_by_the_next_verdict(tmp_path, rule):
    status = {"state": "unacknowledged", "is_active": True, "raised_ns": START_NS, "returned_ns": None}
    entry = {"station": "alpha", "rule": rule, "pump": 2, "standing": status, "delay": {"is_active": True}}
    text = SiteState().model_dump_json().replace('"entries":[]', '"entries":[ENTRY]')
    (tmp_path / "alarms.json").write_text(text.replace("ENTRY", json.dumps(entry)).replace(',"modes":{}', ""))
    site = Station(folder=tmp_path)
    site.news()
    assert site.stands(10, pump=1) == []
    assert site.stands(20, pump=2) == [(f"pump2.{rule}", "returned")]
