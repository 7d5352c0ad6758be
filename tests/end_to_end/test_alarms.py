"""The alarms daemon as a process: kill -9, restart, acts from the command line."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from ports import free_port
from typer.testing import CliRunner

from wetwell.protocols.bus.keys import alarm_act_key, alarm_key, alarm_report_key, verdict_key
from wetwell.protocols.bus.zenoh.link import ZenohBus, open_router
from wetwell.protocols.messages.alarm import Alarm, AlarmAnswer
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.alarms.client import list_alarms, new_act, send_act
from wetwell.services.cli import app

pytestmark = pytest.mark.check

LIMIT_S = 60.0


@contextlib.contextmanager
def alarms(endpoint: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "wetwell.services", "alarms", "--zenoh", endpoint],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"WETWELL_ALARMS__STATE_DIR": str(folder)},
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


def verdict(state: str, time: int) -> bytes:
    told = Verdict(
        time=time, station="alpha", pump=2, state=state, probability={}, evidence={}, window=(time - 1, time)
    )
    return told.encode()


def commands(endpoint: str) -> None:
    """What an operator types."""

    def ask(code: int, *words: str) -> str:
        result = CliRunner().invoke(app, ["alarms", *words, "--zenoh", endpoint])
        assert result.exit_code == code, result.output
        return result.output

    def act(code: int, name: str, alarm: str, *words: str) -> dict[str, object]:
        return json.loads(ask(code, name, alarm, "--station", "alpha", "--by", "bob", "--json", *words))

    (listed,) = json.loads(ask(0, "list", "--json"))["alarms"]
    assert (listed["id"], listed["state"], listed["by"]) == ("pump2.pump_fault", "acknowledged", "ann")
    assert "pump2.pump_fault  acknowledged" in ask(0, "list", "--station", "alpha")
    assert ask(0, "list", "--station", "beta") == "no alarms\n"
    refused = act(1, "acknowledge", "pump2.pump_fault")
    assert refused == {"done": False, "reason": "acknowledge: the alarm is acknowledged"}
    assert act(0, "shelve", "pump1.pump_fault", "--minutes", "10")["state"] == "shelved"
    assert act(0, "unshelve", "pump1.pump_fault")["state"] == "normal"
    assert act(0, "out-of-service", "pump1.pump_fault", "--reason", "workshop")["state"] == "out_of_service"
    assert act(0, "in-service", "pump1.pump_fault")["by"] == "bob"
    report = json.loads(ask(0, "report", "--json"))
    assert (report["rates"]["alarms_day"], report["standing"]) == (2.0, {"acknowledged": 1, "normal": 1})
    assert "alarms_10min" in ask(0, "report")


async def answers(bus: ZenohBus) -> None:
    async with asyncio.timeout(LIMIT_S):
        while not await bus.ask(alarm_report_key(), timeout_s=1.0):
            pass


async def the_alarm(bus: ZenohBus, state: str) -> Alarm:
    async with asyncio.timeout(LIMIT_S):
        while True:
            for alarm in await list_alarms(bus):
                if (alarm.state, alarm.raised) == (state, 40):
                    return alarm
            await asyncio.sleep(0.05)  # a real process: there is no virtual time here


async def life(bus: ZenohBus, endpoint: str, folder: Path) -> list[tuple[str, str]]:
    """What a listener hears while the daemon is killed twice and stopped once."""
    changes = bus.subscribe(alarm_key("*"))
    detector = bus.publisher(verdict_key("alpha", 2), history=100)
    with alarms(endpoint, folder) as first:
        await answers(bus)
        for state, time in (("normal", 10), ("pump_fault", 20), ("normal", 30), ("pump_fault", 40)):
            detector.put(verdict(state, time))
        raised = await the_alarm(bus, "unacknowledged")
        act = new_act("alpha", raised.id, "acknowledge", "ann", None, "seen")
        assert (await send_act(bus, act)).is_done
        first.kill()
        first.communicate()
    with alarms(endpoint, folder) as second:
        await answers(bus)
        kept = await the_alarm(bus, "acknowledged")
        assert kept.by == "ann"
        (payload,) = await bus.ask(alarm_act_key("alpha"), act.encode())
        assert AlarmAnswer.decode(payload).alarm == kept, "an act that is asked again is not carried out again"
        await asyncio.to_thread(commands, endpoint)
        second.send_signal(signal.SIGTERM)
        _, error = await asyncio.to_thread(second.communicate)
        assert (second.returncode, "Traceback" in error) == (0, False)
    with alarms(endpoint, folder):
        await answers(bus)
        detector.put(verdict("normal", 50))
        async with asyncio.timeout(LIMIT_S):
            while await list_alarms(bus):  # noqa: ASYNC110 - another process, which has no event for us
                await asyncio.sleep(0.05)
    heard = [alarm for alarm in map(Alarm.decode, await changes.receive()) if alarm.pump == 2]
    return list(dict.fromkeys((alarm.time, alarm.state) for alarm in heard))  # the last one comes again at a restart


def test_a_killed_daemon_raises_nothing_twice_and_loses_no_act(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with open_router(endpoint) as bus:
        told = asyncio.run(life(bus, endpoint, tmp_path))
    states = [state for _, state in told]
    assert states[-4:] == ["returned", "unacknowledged", "acknowledged", "normal"]
    assert states.count("unacknowledged") <= 2  # one each time that the fault came
    audit = [json.loads(line) for line in (tmp_path / "alarm-audit.jsonl").read_text().splitlines()]
    assert [(line["by"], line.get("after", "refused")) for line in audit] == [
        ("ann", "acknowledged"),
        ("bob", "refused"),
        ("bob", "shelved"),
        ("bob", "normal"),
        ("bob", "out_of_service"),
        ("bob", "normal"),
    ]
