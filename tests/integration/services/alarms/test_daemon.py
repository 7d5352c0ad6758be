"""The service of alarms on a bus: from samples, verdicts and silence to alarms, acts and restarts."""

import asyncio
import json
from dataclasses import dataclass

import pytest
from alarm_site import START_NS, Site
from memory_bus import MemoryBus

from wetwell.protocols.bus.interface import Presence
from wetwell.protocols.bus.keys import alarm_act_key, alarm_key, alive_key, sample_block_key
from wetwell.protocols.messages.alarm import Alarm, AlarmAnswer
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S
from wetwell.services.alarms.client import list_alarms, new_act, report, send_act
from wetwell.services.alarms.daemon import keep
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.runtime.settings import AlarmSettings


@pytest.mark.parametrize("size", [1, 10, 60])
def test_delays_are_as_long_with_gathered_samples_as_with_single_ones(size):
    rules = {"detector_silent": {"on_delay_s": 120.0}, "pump_fault": {"on_delay_s": 300.0}}
    site = Site(stale_after_s=90.0, rules=rules)
    news: dict[str, float] = {}
    for second in range(1, 600):
        site.wall_s = float(second)
        if second % size == 0:
            site.block(size)
        if second == 60:
            site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=True))
            site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=False))
        if second >= 120 and second % 60 == 0:  # on a run that ended within the last block
            news |= {name: site.wall_s for name, _ in site.verdict("pump_fault", at_s=second - 25.0)}
        news |= {name: site.wall_s for name, _ in site.look()}
    assert news["detector_silent"] == pytest.approx(60.0 + 30.0 + 120.0, abs=2.0)
    assert news["pump2.pump_fault"] == pytest.approx(95.0 + 300.0, abs=size)


def test_a_verdict_raises_with_its_advice_unknown_changes_nothing_and_normal_clears():
    site = Site()
    assert site.verdict("learning") == []
    severity = {"speed_loss_percent": {"value": 9.0, "interval": [8.0, 10.0]}}
    assert site.verdict("pump_fault", 10, advice="pull it", severity=severity) == [
        ("pump2.pump_fault", "unacknowledged")
    ]
    (alarm,) = site.told
    assert (alarm.text, alarm.advice) == ("pump 2: pump fault, p = 0.995, speed loss 9 % (8 to 10)", "pull it")
    assert (alarm.raised, alarm.priority, alarm.pump) == (START_NS + 10 * NS_PER_S, "high", 2)
    assert site.verdict("pump_fault", 20) == []
    assert site.verdict("unknown", 30) == []
    assert site.verdict("system_fault", 40) == [
        ("main.system_fault", "unacknowledged"),
        ("pump2.pump_fault", "returned"),
    ]
    assert site.verdict("normal", 50) == [("main.system_fault", "returned")]


def test_each_change_of_an_alarm_is_kept_for_who_comes_late():
    site = Site()
    site.verdict("pump_fault", 10)
    site.verdict("normal", 20)
    site.verdict("pump_fault", 30)
    late = site.bus.subscribe(alarm_key("*"), history=100)
    assert [Alarm.decode(payload).state for payload in asyncio.run(late.receive())] == [
        "unacknowledged",
        "returned",
        "unacknowledged",
    ]


def test_a_verdict_that_comes_again_or_late_changes_nothing_but_a_clock_set_back_is_followed():
    site = Site()
    site.verdict("normal", 10)
    site.verdict("pump_fault", 20)
    assert site.verdict("normal", 10) == []
    assert site.verdict("normal", 15) == []
    assert site.verdict("normal", 30) == [("pump2.pump_fault", "returned")]
    assert site.verdict("pump_fault", -7200) == []  # at the start it can only be an old one
    site.wall_s = 30.0
    assert [site.verdict("pump_fault", at_s) for at_s in (-3600, -3500, -3400)] == [
        [],
        [],
        [("pump2.pump_fault", "unacknowledged")],
    ]


def test_evidence_of_a_foreign_sender_is_no_reason_to_stop():
    site = Site()
    assert site.verdict("pump_fault", 1, severity=[1], advice={"a": 1}) == [("pump2.pump_fault", "unacknowledged")]
    for payload in (b"", b"{}", b"\xff", b'{"schema": "wetwell.sample/1"}'):
        site.service.handle_sample(payload)
        site.service.handle_verdict(payload)
        site.service.handle_status(payload)
    site.sample(station="../x")
    site.service.handle_presence(Presence("wetwell/**/alive/x", is_alive=True))
    site.sample(station="_site")
    assert site.service.figures()["malformed"] == 12.0
    assert site.service.figures()["foreign"] == 3.0


def test_the_last_year_of_time_stamps_is_no_reason_to_stop():
    site = Site(high_level_m=1.0, rules={"level_high": {"on_delay_s": 0.0}})
    site.sample(2.0, seq=2**63 - 1, at_s=(MAX_STAMP_NS - START_NS) / NS_PER_S - 1e4)
    site.wall_s = 2e4
    assert ("samples_stale", "unacknowledged") in site.look()
    assert site.act("acknowledge", alarm="level_high").is_done
    assert site.look(1.0) == [("level_high", "acknowledged")]


def test_high_level_has_delays_in_station_time_and_a_deadband(alpha):
    site = Site(stations=[alpha])  # limit 2.0 + 0.3 m, deadband 0.05 m, delays 60 s
    assert [site.sample(2.31, at_s) for at_s in range(0, 60, 10)] == [[]] * 6
    assert site.sample(2.31, 60) == [("level_high", "unacknowledged")]
    assert site.told[0].text == "level high: 2.31 m, limit 2.30 m"
    assert [site.sample(2.26, at_s) for at_s in range(70, 200, 10)] == [[]] * 13
    assert [site.sample(level_m, 200) for level_m in (None, float("nan"))] == [[], []]
    assert [site.sample(0.5, 201 + n, quality="bad") for n in range(5)] == [[]] * 5
    assert [site.sample(2.24, at_s) for at_s in range(210, 270, 10)] == [[]] * 6
    assert site.sample(2.24, 270) == [("level_high", "returned")]


def test_the_risk_of_overflow_is_urgent_and_the_setting_beats_the_station_file(alpha):
    sump = alpha.sump.model_copy(update={"overflow_level_m": 2.2})
    site = Site(stations=[alpha.model_copy(update={"sump": sump})])
    assert [site.sample(2.15, at_s) for at_s in (0, 9)] == [[], []]
    assert site.sample(2.15, 10) == [("overflow_risk", "unacknowledged")]
    assert site.told[0].priority == "urgent"
    other = Site(high_level_m=1.2, rules={"level_high": {"on_delay_s": 0.0, "priority": "low"}})
    assert other.sample(1.3) == [("level_high", "unacknowledged")]
    assert other.told[0].priority == "low"
    off = Site(high_level_m=1.2, rules={"level_high": {"on_delay_s": 0.0, "is_enabled": False}})
    assert off.sample(1.3) == []


def test_a_delay_of_verdicts_runs_on_with_the_samples():
    site = Site(rules={"pump_fault": {"on_delay_s": 120.0}})
    site.sample(at_s=0)
    assert site.verdict("pump_fault", 1) == []
    told = [news for at_s in range(2, 200) for news in site.sample(at_s=at_s)]
    assert told == [("pump2.pump_fault", "unacknowledged")]
    assert site.service.registry.records["alpha", "pump2.pump_fault"].status.raised_ns == START_NS + 121 * NS_PER_S


def test_silence_is_told_and_an_end_of_it(alpha):
    site = Site(stations=[alpha])
    site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=True))
    site.service.handle_presence(Presence(alive_key("_site", "historian"), is_alive=True))
    assert site.look(60) == []
    assert site.look(1) == [("samples_stale", "unacknowledged")]
    assert site.told[0].text == "no samples for 61 s"
    site.sample()
    assert site.look() == [("samples_stale", "returned")]
    site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=False))
    site.service.handle_presence(Presence(alive_key("_site", "historian"), is_alive=False))
    assert site.look(30) == []
    assert site.look(1) == [("detector_silent", "unacknowledged"), ("historian_silent", "unacknowledged")]
    assert [alarm.station for alarm in site.told] == ["alpha", "_site"]
    site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=True))
    assert site.look(1) == [("detector_silent", "returned")]


def test_a_plant_that_is_held_is_not_missed_until_it_has_died():
    site = Site()
    site.sample()
    held = {"time": 0, "station": "alpha", "service": "simulator", "state": "running", "figures": {"held": 1.0}}
    site.service.handle_presence(Presence(alive_key("alpha", "simulator"), is_alive=True))
    site.service.handle_status(Status.model_validate(held).encode())
    assert site.look(100) == []
    site.service.handle_presence(Presence(alive_key("alpha", "simulator"), is_alive=False))
    assert ("samples_stale", "unacknowledged") in site.look(61)


def test_a_stopped_plc_is_told_from_the_figures_of_the_gateway():
    site = Site()
    site.sample()

    def status(at_s, state="running", **figures):
        site.wall_s = at_s
        message = Status(time=0, station="alpha", service="gateway", state=state, figures=figures)
        site.service.handle_status(message.encode())
        return site.news()

    assert status(1, heartbeat_age_s=29.0) == []
    assert status(11, heartbeat_age_s=30.0) == [("plc_stopped", "unacknowledged")]
    assert site.told[0].text == "heartbeat of the PLC stands still for 30 s"
    assert status(21, "waiting", heartbeat_age_s=0.0) == []
    assert status(50, "waiting", heartbeat_age_s=90.0) == []
    assert status(51, "waiting") == [("plc_lost", "unacknowledged")]
    assert status(61, heartbeat_age_s=1.0) == [("plc_lost", "returned"), ("plc_stopped", "returned")]


def test_without_a_router_nobody_else_is_blamed():
    site = Site()
    site.sample()
    site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=True))
    type(site.bus).is_connected, before = property(lambda _: False), MemoryBus.__dict__["is_connected"]
    try:
        site.look()
        site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=False))
        assert site.look(600) == [("bus_lost", "unacknowledged")]
    finally:
        type(site.bus).is_connected = before
    assert site.look(1) == [("bus_lost", "returned")]
    site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=True))
    assert site.look(59) == []


def test_a_clock_of_the_day_that_is_set_raises_nothing():
    site = Site()
    site.sample()
    site.now = lambda: Now(START_NS + 3600 * NS_PER_S, 1.0)
    site.service._now = site.now
    assert site.look() == []


def test_acts_are_carried_out_once_and_audited(tmp_path):
    site = Site(tmp_path)
    site.verdict("pump_fault", 1)
    first = site.act("acknowledge", id="one", reason="seen")
    assert (first.is_done, first.alarm.state, first.alarm.by) == (True, "acknowledged", "ann")
    assert site.act("acknowledge", id="one") == first
    again = site.act("acknowledge", id="two")
    assert (again.is_done, again.reason) == (False, "acknowledge: the alarm is acknowledged")
    assert not site.act("acknowledge", alarm="nothing").is_done
    assert not site.act("acknowledge", station="beta").is_done
    assert site.act("shelve", id="three", minutes=5).alarm.until == START_NS + 300 * NS_PER_S
    assert site.act("out_of_service", alarm="pump3.pump_fault", id="four").is_done
    site.news()
    assert site.look(299) == []
    assert site.look(1) == [("pump2.pump_fault", "unacknowledged")]
    lines = [json.loads(line) for line in (tmp_path / "alarm-audit.jsonl").read_text().splitlines()]
    assert [(line["act"], line.get("before"), line.get("after", line.get("refused"))) for line in lines] == [
        ("acknowledge", "unacknowledged", "acknowledged"),
        ("acknowledge", None, "acknowledge: the alarm is acknowledged"),
        ("acknowledge", None, lines[2]["refused"]),
        ("shelve", "acknowledged", "shelved"),
        ("out_of_service", "normal", "out_of_service"),
        ("unshelve", "shelved", "unacknowledged"),
    ]
    assert lines[0] | {"by": "ann", "alarm": "pump2.pump_fault", "time": "2026-01-01T00:00:00Z"} == lines[0]
    assert lines[-1]["by"] == "end of shelf"


def test_an_act_that_cannot_be_written_down_is_not_done(tmp_path, caplog):
    site = Site(tmp_path)
    site.verdict("pump_fault", 1)
    (tmp_path / "alarm-audit.jsonl").mkdir()
    answer = site.act("acknowledge", id="one")
    assert (answer.is_done, answer.reason) == (False, "the audit cannot be written, so nothing was done")
    assert "alarm-audit.jsonl: cannot be written: Is a directory" in caplog.text
    (tmp_path / "alarm-audit.jsonl").rmdir()
    assert site.act("acknowledge", id="one").is_done


def test_half_a_line_of_a_power_cut_does_not_spoil_the_next(tmp_path):
    site = Site(tmp_path)
    site.verdict("pump_fault", 1)
    (tmp_path / "alarm-audit.jsonl").write_text('{"time": "20')
    assert site.act("acknowledge").is_done
    assert json.loads((tmp_path / "alarm-audit.jsonl").read_text().splitlines()[1])["act"] == "acknowledge"


def test_a_restart_raises_nothing_again_and_forgets_no_act(tmp_path):
    site = Site(tmp_path, high_level_m=2.0)
    for at_s in range(100):
        site.sample(2.5, at_s)
    site.verdict("pump_fault", 50)
    site.verdict("normal", 60)
    site.verdict("pump_fault", 70)
    done = site.act("acknowledge", id="one")
    site.news()
    site.start()  # as after kill -9: nothing was saved since
    assert {alarm.id: alarm.state for alarm in site.service.registry.alarms()} == {
        "pump2.pump_fault": "acknowledged",
        "level_high": "unacknowledged",
    }
    assert [
        site.verdict(state, at_s) for state, at_s in (("pump_fault", 50), ("normal", 60), ("pump_fault", 70))
    ] == [[]] * 3
    assert [site.sample(2.5, at_s, seq=at_s + 1) for at_s in range(100)] == [[]] * 100
    assert site.act("acknowledge", id="one") == done
    assert site.verdict("normal", 80) == [("pump2.pump_fault", "normal")]


def test_what_comes_after_a_restart_is_raised_at_its_time(tmp_path):
    site = Site(tmp_path)
    site.sample(at_s=0)
    site.service.save()
    site.wall_s = 3600.0  # the machine had no power, and samples of that hour come late
    site.start()
    for at_s in range(1, 5):
        site.sample(at_s=at_s)
    assert ("samples_stale", "unacknowledged") in site.look(120)
    assert site.told[0].raised == START_NS + 3720 * NS_PER_S


def test_a_detector_that_does_not_come_back_with_us_is_missed(tmp_path):
    site = Site(tmp_path)
    site.sample()
    site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=True))
    site.service.save()
    site.start()
    assert site.look(30) == []
    assert ("detector_silent", "unacknowledged") in site.look(1)


def test_a_silence_that_is_told_stands_over_a_restart_until_it_ends(tmp_path):
    site = Site(tmp_path)
    site.sample()
    for station, service in (("alpha", "detector"), ("_site", "gateway")):
        site.service.handle_presence(Presence(alive_key(station, service), is_alive=True))
        site.service.handle_presence(Presence(alive_key(station, service), is_alive=False))
    assert len(site.look(61)) == 3
    site.start()
    assert site.look(1) == site.look(61) == []
    site.sample()
    site.service.handle_presence(Presence(alive_key("alpha", "detector"), is_alive=True))
    site.service.handle_presence(Presence(alive_key("_site", "gateway"), is_alive=True))
    assert {name for name, state in site.look() if state == "returned"} == {
        "samples_stale",
        "detector_silent",
        "gateway_silent",
    }


@pytest.mark.parametrize("damage", [lambda text: text[:-20], lambda text: text.replace("state/1", "state/9")])
def test_a_damaged_state_is_put_aside_and_told(damage, tmp_path, caplog):
    site = Site(tmp_path)
    site.verdict("pump_fault", 1)
    file = tmp_path / "alarms.json"
    file.write_text(damage(file.read_text()))
    site.start()
    assert site.service.registry.alarms() == []
    assert "kept as alarms.refused, the alarms begin anew" in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == ["alarms.refused"]


def test_a_disk_that_refuses_is_told_and_the_alarm_is_shown_all_the_same(tmp_path, caplog):
    site = Site(tmp_path / "state")
    (tmp_path / "state").rmdir()
    assert site.verdict("pump_fault", 1) == [("pump2.pump_fault", "unacknowledged")]
    assert site.service.figures()["disk_errors"] == 1.0
    assert "alarms go on without" in caplog.text
    (tmp_path / "state").mkdir()
    site.look()
    assert site.service.figures()["disk_errors"] == 0.0
    site.start()
    assert [alarm.id for alarm in site.service.registry.alarms()] == ["pump2.pump_fault"]


def test_chattering_and_stale_alarms_are_on_their_lists():
    site = Site()
    for number in range(12):
        site.verdict("pump_fault" if number % 2 == 0 else "normal", 60 * number)
    site.sample(at_s=60 * 12)
    (chattering,) = site.service.report().chattering
    assert (chattering.alarm, chattering.transitions) == ("pump2.pump_fault", 12)
    site.verdict("system_fault", 800, pump=1)
    site.sample(at_s=800 + 86_400)
    assert site.service.report().stale == ()
    site.sample(at_s=801 + 86_400)
    (stale,) = site.service.report().stale
    assert (stale.alarm, stale.raised) == ("main.system_fault", START_NS + 800 * NS_PER_S)
    assert site.service.report().chattering == ()
    assert site.service.report().rates["alarms_day"] == 7.0


@dataclass
class Question:
    key: str
    payload: bytes
    answer: AlarmAnswer | None = None

    def reply(self, payload: bytes) -> None:
        self.answer = AlarmAnswer.decode(payload)


def test_an_act_is_refused_on_the_key_of_another_station():
    site = Site()
    site.verdict("pump_fault", 1)
    act = new_act("alpha", "pump2.pump_fault", "acknowledge", "ann", None, "")
    for key, done in (("wetwell/beta/alarm-act", False), (alarm_act_key("alpha"), True)):
        question = Question(key, act.encode())
        site.service.handle_act(question)
        assert question.answer.is_done is done
    nonsense = Question(alarm_act_key("alpha"), b"{}")
    site.service.handle_act(nonsense)
    assert "missing" in nonsense.answer.reason


def test_over_a_bus_alarms_are_listed_acted_on_and_reported():
    async def day() -> None:
        with MemoryBus() as bus:
            loop = asyncio.get_running_loop()
            service = AlarmService(bus, AlarmSettings(), (), lambda: Now(START_NS, loop.time()))
            running = asyncio.create_task(keep(bus, service, 10.0))
            await asyncio.sleep(0)
            verdict = Verdict(
                time=1, station="alpha", pump=1, state="system_fault", probability={}, evidence={}, window=(0, 1)
            )
            bus.publisher("wetwell/alpha/verdict/1").put(verdict.encode())
            await asyncio.sleep(0.01)
            (alarm,) = await list_alarms(bus)
            answer = await send_act(bus, new_act("alpha", alarm.id, "acknowledge", "ann", None, ""))
            assert answer.alarm.state == "acknowledged"
            assert (await list_alarms(bus, "alpha"))[0] == answer.alarm
            assert (await report(bus)).standing == {"acknowledged": 1}
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    asyncio.run(day())


def test_over_a_bus_samples_come_gathered_too_those_that_were_sent_before_and_those_that_come():
    def block(first: int, level_m: float) -> bytes:
        return SampleBlock.of(
            [
                Sample(station="alpha", seq=seq, time=START_NS + seq * NS_PER_S, level_m=level_m, pumps=())
                for seq in range(first, first + 10)
            ]
        ).encode()

    async def day() -> None:
        with MemoryBus() as bus:
            publisher = bus.publisher(sample_block_key("alpha"), history=10)
            publisher.put(block(0, 1.0))
            service = AlarmService(bus, AlarmSettings(high_level_m=2.0), (), lambda: Now(START_NS, 0.0))
            running = asyncio.create_task(keep(bus, service, 10.0))
            await asyncio.sleep(0.01)
            assert service.figures()["samples"] == 10.0
            assert await list_alarms(bus) == []
            for first in range(10, 200, 10):
                publisher.put(block(first, 9.0))
            await asyncio.sleep(0.01)
            assert service.figures()["samples"] == 200.0
            assert [alarm.id for alarm in await list_alarms(bus)] == ["level_high"]
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    asyncio.run(day())
