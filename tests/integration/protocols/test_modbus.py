"""The Modbus server against real clients: pyModbusTCP, mbpoll and plain sockets on the loopback interface."""

import asyncio
import logging
import math
import random
import shutil
import socket

import pytest
from pyModbusTCP.client import ModbusClient
from pyModbusTCP.utils import decode_ieee, encode_ieee, long_list_to_word, word_list_to_long

from wetwell.protocols.errors import LinkError
from wetwell.protocols.modbus.server import ModbusServer

WAIT_S = 10.0
MEASURED = {"level_m": 1.25, "inflow_m3h": 80.5, "pump1_head_m": 9.5, "pump2_power_kw": 7.75, "pump2_running": 1}
needs_mbpoll = pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll (Debian package) is not installed")


def make(on_write=lambda _changes: None, **settings):
    defaults = {"host": "127.0.0.1", "port": 0, "unit_id": 1, "word_order": "ABCD", "pumps": 2, "levels": 2}
    return ModbusServer(**(defaults | settings), on_write=on_write)


class Client:
    """pyModbusTCP, in threads, with floats of either word order."""

    def __init__(self, server, *, unit_id=1, word_order="ABCD"):
        self.peer = ModbusClient("127.0.0.1", server.port, unit_id, timeout=WAIT_S)
        self.is_big = word_order == "ABCD"

    async def ask(self, method, *arguments):
        return await asyncio.to_thread(getattr(self.peer, method), *arguments)

    async def floats(self, address, count=1, table="holding"):
        words = await self.ask(f"read_{table}_registers", address, 2 * count)
        return [decode_ieee(value) for value in word_list_to_long(words, big_endian=self.is_big)]

    async def write_floats(self, address, *values):
        words = long_list_to_word([encode_ieee(value) for value in values], big_endian=self.is_big)
        return await self.ask("write_multiple_registers", address, words)

    @property
    def exception(self):
        return self.peer.last_except

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        self.peer.close()


async def mbpoll(server, *options, value=()):
    process = await asyncio.create_subprocess_exec(
        "mbpoll",
        *("-m", "tcp", "-a", "1", "-p", str(server.port), "-0", "-1", "-o", "5"),
        *options,
        "127.0.0.1",
        *value,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    output, _ = await asyncio.wait_for(process.communicate(), WAIT_S)
    values = [line.split("\t")[1].strip() for line in output.decode().splitlines() if line.startswith("[")]
    return process.returncode, values, output.decode()


async def exchange(server, pdu, *, unit_id=1):
    """Answer's function code and data to a hand-made request."""
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    try:
        body = bytes([unit_id]) + bytes.fromhex(pdu)
        writer.write(b"\x00\x07\x00\x00" + len(body).to_bytes(2, "big") + body)
        async with asyncio.timeout(WAIT_S):
            head = await reader.readexactly(7)
            return await reader.readexactly(int.from_bytes(head[4:6], "big") - 1)
    finally:
        writer.close()
        await writer.wait_closed()


@pytest.mark.parametrize("word_order", ["ABCD", "CDAB"])
@pytest.mark.parametrize("table", ["holding", "input"])
def test_measured_values_under_both_function_codes(table, word_order):
    async def scenario():
        async with make(word_order=word_order) as server:
            server.update(MEASURED | {"time_s": 1_700_000_000})
            with Client(server, word_order=word_order) as client:
                assert await client.floats(0, 2, table) == [1.25, 80.5]
                assert await client.floats(104, 1, table) == [9.5]
                words = await client.ask(f"read_{table}_registers", 6, 2)
                assert word_list_to_long(words, big_endian=client.is_big) == [1_700_000_000]
                assert await client.ask(f"read_{table}_registers", 128, 1) == [1]

    asyncio.run(scenario())


@needs_mbpoll
@pytest.mark.parametrize(("word_order", "flags"), [("ABCD", ("-B",)), ("CDAB", ())])
@pytest.mark.parametrize("table", ["4:float", "3:float"])
def test_mbpoll_reads_floats(table, word_order, flags):
    async def scenario():
        async with make(word_order=word_order) as server:
            server.update(MEASURED | {"inflow_m3h": None})
            code, values, output = await mbpoll(server, "-t", table, *flags, "-r", "0", "-c", "2")
            assert code == 0, output
            assert values == ["1.25", "nan"]
            assert (await mbpoll(server, "-t", table, *flags, "-r", "104"))[1] == ["9.5"]

    asyncio.run(scenario())


@needs_mbpoll
def test_mbpoll_writes_levels_and_coils_but_no_measured_value():
    seen = []

    async def scenario():
        async with make(seen.append) as server:
            server.update(MEASURED)
            assert (await mbpoll(server, "-t", "4:float", "-B", "-r", "1000", value=("1.75", "0.5")))[0] == 0
            assert (await mbpoll(server, "-t", "0", "-r", "1", value=("1",)))[0] == 0
            assert (await mbpoll(server, "-t", "0", "-r", "0", "-c", "2"))[1] == ["0", "1"]
            code, _, output = await mbpoll(server, "-t", "4:float", "-B", "-r", "0", value=("3.5",))
            assert code == 1
            assert "Illegal data address" in output

    asyncio.run(scenario())
    assert seen == [{"start_level1_m": 1.75, "stop_level1_m": 0.5}, {"pump2_auto": 1.0}]


def test_no_value_is_nan_and_before_the_first_update_there_is_none():
    async def scenario():
        async with make() as server:
            with Client(server) as client:
                assert all(map(math.isnan, await client.floats(0, 2)))
                server.update(MEASURED)
                assert await client.floats(0) == [1.25]
                server.update({"level_m": math.nan})
                assert math.isnan((await client.floats(0))[0])

    asyncio.run(scenario())


def test_heartbeat_counts():
    async def scenario():
        async with make() as server:
            with Client(server) as client:
                beats = []
                for scan in (1, 2, 65535):
                    server.update({"heartbeat": scan})
                    beats += await client.ask("read_input_registers", 4, 1)
        return beats

    assert asyncio.run(scenario()) == [1, 2, 65535]


def test_update_refuses_what_does_not_fit_and_then_changes_nothing():
    server = make()
    server.update({"heartbeat": 1})
    with pytest.raises(ValueError, match="'pump3_head_m' is not a register of this station"):
        server.update({"heartbeat": 2, "pump3_head_m": 1.0})
    with pytest.raises(ValueError, match=r"heartbeat must be a whole number in \[0, 65535\]"):
        server.update({"pump1_running": 1, "heartbeat": 65536})

    async def scenario():
        async with server:
            with Client(server) as client:
                return await client.ask("read_holding_registers", 4, 1), await client.ask(
                    "read_holding_registers", 108, 1
                )

    assert asyncio.run(scenario()) == ([1], [0])


@pytest.mark.parametrize("word_order", ["ABCD", "CDAB"])
def test_levels_written_together_arrive_together(word_order):
    seen = []

    async def scenario():
        async with make(seen.append, word_order=word_order) as server:
            with Client(server, word_order=word_order) as client:
                assert await client.write_floats(1000, 1.5, 0.5, 2.0, 0.75)
                assert await client.floats(1000, 4) == [1.5, 0.5, 2.0, 0.75]
                assert await client.write_floats(1006, 1.0)
                assert await client.floats(1004, 2) == [2.0, 1.0]

    asyncio.run(scenario())
    assert seen == [
        {"start_level1_m": 1.5, "stop_level1_m": 0.5, "start_level2_m": 2.0, "stop_level2_m": 0.75},
        {"stop_level2_m": 1.0},
    ]


def refuse(_changes):
    raise ValueError("stop level must lie under start level")


def test_a_refused_write_changes_nothing():
    async def scenario():
        async with make(refuse) as server:
            server.update({"start_level1_m": 1.5, "stop_level1_m": 0.5, "pump1_auto": 1})
            with Client(server) as client:
                assert not await client.write_floats(1000, 1.0, 2.0)
                assert client.exception == 3
                assert not await client.ask("write_single_coil", 0, False)
                assert client.exception == 3
                assert await client.floats(1000, 2) == [1.5, 0.5]
                assert await client.ask("read_coils", 0, 2) == [True, False]
            assert (server.requests, server.refused) == (4, 2)

    asyncio.run(scenario())


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_level_must_be_a_number(value):
    seen = []

    async def scenario():
        async with make(seen.append) as server:
            server.update({"start_level1_m": 1.5})
            with Client(server) as client:
                assert not await client.write_floats(1000, value)
                assert client.exception == 3
                assert await client.floats(1000) == [1.5]

    asyncio.run(scenario())
    assert seen == []


@pytest.mark.parametrize(
    ("pdu", "answer"),
    [
        ("10 0000 0002 04 3f80 0000", "90 02"),  # measured value
        ("06 0004 0001", "86 02"),  # heartbeat
        ("10 0006 0002 04 0000 0001", "90 02"),  # clock
        ("06 0320 0001", "86 02"),  # unknown address
        ("10 03ea 0004 08 3f80 0000 3f80 0000", "10 03ea 0004"),  # stop level 1 and start level 2 adjoin
        ("10 03ee 0004 08 3f80 0000 3f80 0000", "90 02"),  # beyond the last level
        ("06 03e8 3f80", "86 02"),  # half a float
        ("10 03e9 0002 04 3f80 0000", "90 02"),  # halves of two floats
        ("10 03e8 0003 06 3f80 0000 3f80", "90 02"),  # one and a half
        ("16 0000 0000 ffff", "96 02"),  # mask write on a measured value
        ("16 03e8 ffff 0000", "96 02"),  # and on half a level
        ("17 0000 0001 0000 0002 04 3f80 0000", "97 02"),  # read-write on a measured value
        ("17 0000 0001 03e8 0002 04 3f80 0000", "17 02 7fc0"),
        ("17 0fff 0001 03e8 0002 04 4000 0000", "97 02"),  # read part out of range: must not write
        ("0f 0000 0003 01 07", "8f 02"),  # third coil of two
        ("0f 0000 0002 01 03", "0f 0000 0002"),
        ("05 0002 ff00", "85 02"),
        ("05 0000 ff00", "05 0000 ff00"),
        ("05 0000 1234", "85 03"),  # neither on nor off
        ("01 0002 0001", "81 02"),
        ("03 008d 0001", "83 02"),  # behind the last pump
        ("03 0000 007e", "83 03"),  # more words than a request may have
        ("03 0000 0000", "83 03"),
        ("02 0000 0001", "82 01"),
        ("08 ffff 0000", "88 01"),
        ("41", "c1 01"),
        ("83 02", "83 01"),
    ],
)
def test_answer_to_a_raw_request(pdu, answer, caplog):
    written = []

    async def scenario():
        async with make(written.append) as server:
            server.update({"start_level1_m": 0.25})
            got = await exchange(server, pdu)
            assert got == bytes.fromhex(answer)
            level = await exchange(server, "03 03e8 0001")
            is_changed = level != bytes.fromhex("03 02 3e80")
            assert is_changed == any("start_level1_m" in changes for changes in written)
            assert server.requests == 2
            assert server.refused == (got[0] > 0x80)

    asyncio.run(scenario())
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]
    assert bool(written) == (answer[0] in "01" and pdu[:2] not in {"01", "03"})


def test_coils():
    seen = []

    async def scenario():
        async with make(seen.append, pumps=20) as server:
            server.update({"pump20_auto": 1})
            with Client(server) as client:
                assert await client.ask("write_single_coil", 0, True)
                assert await client.ask("write_multiple_coils", 15, [True, False, True])
                assert await client.ask("read_coils", 14, 6) == [False, True, False, True, False, True]
                assert await client.ask("read_coils", 0, 1) == [True]

    asyncio.run(scenario())
    assert seen == [{"pump1_auto": 1.0}, {"pump16_auto": 1.0, "pump17_auto": 0.0, "pump18_auto": 1.0}]


@pytest.mark.parametrize("unit_id", [0, 2, 255])
@pytest.mark.parametrize("pdu", ["03 0000 0002", "10 03e8 0002 04 3f80 0000", "2b 0e01 00"])
def test_another_unit_id_gets_an_exception_and_no_traceback(unit_id, pdu, caplog):
    seen = []

    async def scenario():
        async with make(seen.append) as server:
            server.update(MEASURED)
            got = await exchange(server, pdu, unit_id=unit_id)
            assert got == bytes([int(pdu[:2], 16) | 0x80, 11])
            with Client(server) as client:
                assert await client.floats(0) == [1.25]

    asyncio.run(scenario())
    assert seen == []
    assert not caplog.records


def test_a_unit_id_out_of_range_is_refused():
    with pytest.raises(ValueError, match=r"unit_id must lie in \[0, 255\], got 256"):
        make(unit_id=256)


def test_fifty_clients_at_once_see_one_update_each():
    async def read(server, together, number):
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        for turn in range(20):
            server.update(dict.fromkeys(("level_m", "pump1_head_m"), 100.0 * number + turn))
            writer.write(bytes.fromhex("0001 0000 0006 01 04 0000 007d"))
            words = (await reader.readexactly(9 + 250))[9:]
            assert words[0:4] == words[2 * 104 : 2 * 104 + 4]
        await together.wait()
        assert server.clients == 50
        await together.wait()
        writer.close()
        await writer.wait_closed()

    async def scenario():
        async with make() as server:
            together = asyncio.Barrier(50)
            async with asyncio.timeout(6 * WAIT_S), asyncio.TaskGroup() as group:
                for number in range(50):
                    group.create_task(read(server, together, number))
            return server.requests, server.refused

    assert asyncio.run(scenario()) == (1000, 0)


def test_garbage_leaves_the_server_alive():
    async def throw(server, garbage):
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(garbage)
        writer.write_eof()
        async with asyncio.timeout(WAIT_S):
            while await reader.read(4096):
                pass
        writer.close()
        await writer.wait_closed()

    async def scenario():
        rng = random.Random(7)
        async with make() as server:
            server.update(MEASURED)
            for size in (0, 1, 7, 8, 300, 5000):
                await throw(server, rng.randbytes(size))
            for _ in range(60):
                body = b"\x01" + rng.randbytes(rng.randint(0, 20))
                await throw(server, b"\x00\x01\x00\x00" + len(body).to_bytes(2, "big") + body)
            with Client(server) as client:
                assert await client.floats(0) == [1.25]

    asyncio.run(scenario())


def test_a_port_in_use_is_named():
    async def scenario(port):
        async with make(port=port):
            pytest.fail("listens on a port in use")

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(LinkError, match=rf"^Modbus TCP 127\.0\.0\.1:{port}: cannot listen: .*in use"):
            asyncio.run(scenario(port))


def test_leaving_closes_connections_ends_tasks_and_frees_the_port():
    async def scenario():
        async with make() as server:
            port = server.port
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(bytes.fromhex("0001 0000 0006 01 03 0000 0002"))
            async with asyncio.timeout(WAIT_S):
                assert len(await reader.readexactly(13)) == 13
            assert server.clients == 1
        assert asyncio.all_tasks() == {asyncio.current_task()}
        assert server.clients == 0
        try:
            async with asyncio.timeout(WAIT_S):
                assert await reader.read() == b""
        except ConnectionResetError:
            pass
        writer.close()
        async with make(port=port) as again:
            assert again.port == port

    asyncio.run(scenario())
