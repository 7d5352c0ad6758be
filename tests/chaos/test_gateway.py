"""A PLC that errs in every way, beside one that does not: what is lost, what is said, how long until right again."""

import asyncio
import contextlib
import random
import socket
import statistics
import struct
from dataclasses import dataclass, field
from itertools import pairwise

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import sample_key, status_key
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.status import Status
from wetwell.protocols.modbus.device_map import Device, Plc
from wetwell.protocols.modbus.device_signal import Signal
from wetwell.services.gateway.daemon import poll_all
from wetwell.services.gateway.poller import connection_to

pytestmark = pytest.mark.check

PERIOD_S = 0.05
ANSWER_TIMEOUT_S = 0.4
HEARTBEAT_S = 0.3
LONGEST_WAIT_S = 0.2
HOLD_S = 0.25
"""Time that a fault lasts after it has been told."""
WAIT_S = 20.0
RIGHT_AGAIN_S = 5.0
"""By these settings it takes at most .7 s; the rest is for a machine that is busy with other tests."""
PATIENT = {"answer_timeout_s": 10.0}
"""For tests in which no answer is missing."""

SIGNALS = {
    "level_m": Signal(address=0, type="uint16", table="input"),
    "heartbeat": Signal(address=1, type="uint16", table="input"),
    "pump1_power_kw": Signal(address=2, type="uint16", table="input"),
    "pump1_flow_m3h": Signal(address=100, type="uint16", table="holding"),
}


class ScriptedPlc:
    """Speaks Modbus by hand. Its level is the number of the question, so that no answer can pass for another."""

    def __init__(self):
        self.act = well
        self.asked = 0
        self.beat = 0
        self.beats = True
        self.connections = 0
        self.late_levels = set()
        self.port = 0
        self._writers = set()
        self._server = None

    async def __aenter__(self):
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_error):
        self._server.close()
        for writer in tuple(self._writers):
            writer.transport.abort()
        await self._server.wait_closed()

    async def _serve(self, reader, writer):
        self.connections += 1
        self._writers.add(writer)
        try:
            while True:
                question = await reader.readexactly(12)
                self.asked += 1
                self.beat = (self.beat + self.beats) % 0x10000
                await self.act(self, question, writer)
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            self._writers.discard(writer)
            writer.transport.abort()

    def answer(self, question):
        transaction, _, _, unit, function, address, count = struct.unpack(">HHHBBHH", question)
        registers = {0: self.asked % 0x10000, 1: self.beat, 2: 7, 100: 80}
        words = [registers.get(address + n, 0) for n in range(count)]
        return struct.pack(f">HHHBBB{count}H", transaction, 0, 3 + 2 * count, unit, function, 2 * count, *words)


async def well(plc, question, writer):
    writer.write(plc.answer(question))


async def late(plc, question, writer):
    plc.late_levels.add(plc.asked)
    answer = plc.answer(question)
    await asyncio.sleep(1.5 * ANSWER_TIMEOUT_S)
    writer.write(answer)


async def never(_plc, _question, _writer):
    pass


async def half_then_silence(plc, question, writer):
    writer.write(plc.answer(question)[:8])


async def half_then_close(plc, question, writer):
    writer.write(plc.answer(question)[:8])
    await writer.drain()
    raise ConnectionError


async def reset(_plc, _question, _writer):
    raise ConnectionError


async def doubled(plc, question, writer):
    writer.write(2 * plc.answer(question))


def changed(at, value):
    """Answer with another byte."""

    async def act(plc, question, writer):
        answer = bytearray(plc.answer(question))
        answer[at] = value
        writer.write(answer)

    return act


async def next_transaction(plc, question, writer):
    transaction = int.from_bytes(question[:2], "big") + 1
    writer.write(transaction.to_bytes(2, "big") + plc.answer(question)[2:])


async def no_transaction(plc, question, writer):
    writer.write(b"\x00\x00" + plc.answer(question)[2:])


async def noise(plc, _question, writer):
    writer.write(random.Random(plc.asked).randbytes(64))


async def web_page(_plc, _question, writer):
    writer.write(b"HTTP/1.1 400 Bad Request\r\n\r\n")


def exception(code, *, of=range(65536)):
    """Refuse questions that touch these addresses."""

    async def act(plc, question, writer):
        address, count = struct.unpack(">HH", question[8:])
        if set(range(address, address + count)).isdisjoint(of):
            return await well(plc, question, writer)
        return writer.write(question[:4] + bytes([0, 3, question[6], question[7] | 0x80, code]))

    return act


def plc_at(station, port, **device):
    settings = {
        "station": station,
        "host": "127.0.0.1",
        "port": port,
        "period_s": PERIOD_S,
        "answer_timeout_s": ANSWER_TIMEOUT_S,
        "heartbeat_s": HEARTBEAT_S,
    }
    return Plc(station=station, pumps=1, device=Device(**(settings | device)), signals=SIGNALS)


@dataclass
class Watch:
    """What the bus has brought of one station."""

    station: str
    bus: MemoryBus
    samples: list = field(default_factory=list)
    times_s: list = field(default_factory=list)
    status: Status | None = None

    async def follow(self):
        async with asyncio.TaskGroup() as group:
            group.create_task(self._samples(self.bus.subscribe(sample_key(self.station))))
            group.create_task(self._statuses(self.bus.subscribe(status_key(self.station, "gateway"))))

    async def _samples(self, subscription):
        while True:
            for payload in await subscription.receive():
                self.samples.append(Sample.decode(payload))
                self.times_s.append(asyncio.get_running_loop().time())

    async def _statuses(self, subscription):
        while True:
            for payload in await subscription.receive():
                self.status = Status.decode(payload)

    def usual_gap_s(self, since_s):
        times_s = [time_s for time_s in self.times_s if time_s >= since_s]
        return statistics.median(later - earlier for earlier, later in pairwise(times_s))


async def until(condition):
    async with asyncio.timeout(WAIT_S):
        while not condition():  # noqa: ASYNC110 - real sockets: there is no virtual time here
            await asyncio.sleep(0.01)


@contextlib.asynccontextmanager
async def gateway(*plcs):
    """A gateway that polls these, and what it says of each."""
    bus = MemoryBus()
    watches = [Watch(plc.station, bus) for plc in plcs]
    tasks = [asyncio.create_task(watch.follow()) for watch in watches]
    tasks.append(asyncio.create_task(poll_all(bus, plcs, 0.05, LONGEST_WAIT_S)))
    try:
        yield watches
    finally:
        assert not [task for task in tasks if task.done()], "the gateway has ended by itself"
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


@pytest.mark.parametrize(
    ("act", "said", "counted"),
    [
        (late, "no answer within 0.4 s", "timeouts"),
        (never, "no answer within 0.4 s", "timeouts"),
        (half_then_silence, "no answer within 0.4 s", "timeouts"),
        (half_then_close, "connection closed by the device", "lost_connections"),
        (reset, "connection", "lost_connections"),
        (next_transaction, "transaction id", "wrong_answers"),
        (no_transaction, "transaction id 0, asked with", "wrong_answers"),
        (changed(2, 9), "protocol id 2304, asked with 0", "wrong_answers"),
        (changed(4, 0xFF), "length 65", "wrong_answers"),
        (changed(6, 2), "unit id 2, asked with 1", "wrong_answers"),
        (changed(7, 4), "function 4, count 2, 2 bytes; must be 3, 2, 2", "wrong_answers"),
        (changed(8, 4), "function 3, count 4, 2 bytes; must be 3, 2, 2", "wrong_answers"),
        (noise, "answer to holding 100: ", "wrong_answers"),
        (web_page, "answer to holding 100: ", "wrong_answers"),
        (exception(0x0B), "exception 0B, gateway no response", "refused_polls"),
        (exception(0x06), "exception 06, device busy", "refused_polls"),
        (exception(0x01), "all registers are refused", "refused_polls"),
    ],
)
def test_a_plc_that_errs_is_told_and_comes_back_and_disturbs_no_other(act, said, counted):
    async def scenario():
        async with ScriptedPlc() as plc, ScriptedPlc() as neighbour:
            pair = plc_at("ill", plc.port), plc_at("well", neighbour.port, **PATIENT)
            async with gateway(*pair) as (ill, sound):
                await until(lambda: len(ill.samples) >= 3 and len(sound.samples) >= 3)
                begin_s = asyncio.get_running_loop().time()
                plc.act = act
                await until(lambda: ill.status.state == "waiting" and said in ill.status.reason)
                told, so_far = len(ill.samples), len(sound.samples)
                await asyncio.sleep(HOLD_S)
                await until(lambda: len(sound.samples) > so_far + 2)
                await until(lambda: sound.usual_gap_s(begin_s) < 0.5 * ANSWER_TIMEOUT_S)  # it does not wait, too
                assert len(ill.samples) == told, "nothing is made up while the PLC errs"
                plc.act, well_s = well, asyncio.get_running_loop().time()
                await until(lambda: len(ill.samples) > told + 2)
                assert ill.times_s[told] - well_s < RIGHT_AGAIN_S
                await until(lambda: ill.status.state == "running" and not ill.status.reason)
                assert ill.status.figures[counted] > 0
                assert [sample.seq for sample in ill.samples] == list(range(len(ill.samples)))
                levels = [sample.level_m for sample in ill.samples]
                assert levels == sorted(set(levels)), "an answer was taken for another question's"
                assert plc.late_levels.isdisjoint(levels)
                assert sound.status.figures["polls"] - sound.status.figures["good_polls"] <= 1  # one is on its way

    asyncio.run(scenario())


def test_an_answer_that_comes_twice_is_not_taken_for_the_next():
    async def scenario():
        async with ScriptedPlc() as plc:
            plc.act = doubled
            async with gateway(plc_at("ill", plc.port)) as (ill,):
                await until(lambda: ill.status is not None and ill.status.figures.get("wrong_answers", 0) >= 2)
                levels = [sample.level_m for sample in ill.samples]
                assert levels == sorted(set(levels))
                plc.act, so_far = well, len(ill.samples)
                await until(lambda: len(ill.samples) > so_far + 2)

    asyncio.run(scenario())


def test_a_refused_register_has_no_value_and_the_rest_goes_on():
    async def scenario():
        async with ScriptedPlc() as plc:
            plc.act = exception(2, of=[2])
            async with gateway(plc_at("ill", plc.port, **PATIENT)) as (ill,):
                await until(lambda: len(ill.samples) >= 5)
                pump = ill.samples[-1].pumps[0]
                assert (pump.power_kw, pump.flow_m3h) == (None, 80.0)
                assert {sample.quality for sample in ill.samples} == {"good"}
                await until(lambda: "pump1_power_kw: input 2: refused with exception 02" in ill.status.reason)
                assert ill.status.figures["reconnects"] == 0
                asked, polls = plc.asked, len(ill.samples)
                await until(lambda: len(ill.samples) >= polls + 5)
                assert plc.asked - asked <= 4 * (len(ill.samples) - polls + 1), "found out once, not at each poll"
                plc.act = well
                await until(lambda: ill.samples[-1].pumps[0].power_kw == 7.0 and not ill.status.reason)

    asyncio.run(scenario())


@pytest.mark.parametrize("quality", ["bad", "uncertain"])
def test_samples_of_a_program_that_stands_are_marked(quality):
    async def scenario():
        async with ScriptedPlc() as plc:
            device = plc_at("ill", plc.port, heartbeat_quality=quality, **PATIENT)
            async with gateway(device) as (ill,):
                await until(lambda: len(ill.samples) >= 3)
                plc.beats, stopped_s = False, asyncio.get_running_loop().time()
                await until(lambda: ill.samples[-1].quality == quality)
                first = next(n for n, sample in enumerate(ill.samples) if sample.quality == quality)
                assert ill.times_s[first] - stopped_s < HEARTBEAT_S + RIGHT_AGAIN_S
                await until(lambda: "heartbeat stands for" in ill.status.reason)
                assert ill.status.figures["heartbeat_age_s"] >= HEARTBEAT_S
                plc.beats, counts_s = True, asyncio.get_running_loop().time()
                await until(lambda: ill.samples[-1].quality == "good")
                assert ill.times_s[-1] - counts_s < RIGHT_AGAIN_S
                await until(lambda: not ill.status.reason)

    asyncio.run(scenario())


def test_a_connection_whose_peer_is_gone_without_a_word_is_given_up():
    async def scenario():
        async with ScriptedPlc() as plc, gateway(plc_at("ill", plc.port)) as (ill,):
            await until(lambda: len(ill.samples) >= 3)
            deaf = plc.connections

            async def half_open(plc, question, writer):
                if plc.connections > deaf:
                    await well(plc, question, writer)

            plc.act, gone_s = half_open, asyncio.get_running_loop().time()
            so_far = len(ill.samples)
            await until(lambda: len(ill.samples) >= so_far + 3)
            assert ill.times_s[so_far] - gone_s < ANSWER_TIMEOUT_S + RIGHT_AGAIN_S
            await until(lambda: ill.status.figures.get("timeouts") == 1)
            assert ill.status.figures["reconnects"] == 1

    asyncio.run(scenario())


def test_the_system_looks_after_a_peer_that_is_not_asked():
    async def scenario():
        async with ScriptedPlc() as plc, connection_to(plc_at("ill", plc.port)) as connection:
            peer = connection._writer.get_extra_info("socket")
            assert peer.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
            assert peer.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == 10

    asyncio.run(scenario())


def test_a_plc_that_is_killed_and_started_again():
    async def scenario():
        plc = ScriptedPlc()
        async with plc:
            device = plc_at("ill", plc.port)
            async with contextlib.AsyncExitStack() as stack:
                (ill,) = await stack.enter_async_context(gateway(device))
                await until(lambda: len(ill.samples) >= 3)
                await plc.__aexit__()
                await until(lambda: "cannot connect: connection refused" in ill.status.reason)
                told = len(ill.samples)
                await asyncio.sleep(HOLD_S)
                assert len(ill.samples) == told
                again_s = asyncio.get_running_loop().time()
                await plc.__aenter__()
                await until(lambda: len(ill.samples) >= told + 3)
                assert ill.times_s[told] - again_s < RIGHT_AGAIN_S
                assert ill.status.figures["failed_connections"] >= 1

    asyncio.run(scenario())


def test_tries_at_a_plc_that_is_away_become_rarer(monkeypatch):
    waits_s = []

    def uniform(low, high):
        waits_s.append(high)
        return low

    monkeypatch.setattr("wetwell.services.gateway.poller.random.uniform", uniform)

    async def scenario():
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))  # and does not listen
            bus = MemoryBus()
            polling = asyncio.create_task(poll_all(bus, [plc_at("away", taken.getsockname()[1])], 10.0, 30.0))
            await until(lambda: len(waits_s) >= 8)
            polling.cancel()
            await asyncio.gather(polling, return_exceptions=True)

    asyncio.run(scenario())
    assert waits_s[:7] == [2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 30.0]
