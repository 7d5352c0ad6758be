"""The gateway against PLCs that others have written: libmodbus, pyModbusTCP, our own, and one behind TLS."""

import asyncio
import contextlib
import shutil
import ssl
import subprocess
from pathlib import Path

import pytest
import trustme
from memory_bus import MemoryBus
from ports import free_port
from pyModbusTCP.server import DataBank
from pyModbusTCP.server import ModbusServer as ForeignServer
from pyModbusTCP.utils import encode_ieee, long_list_to_word

from wetwell.protocols.bus.keys import sample_key
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.modbus.device_map import load_plcs
from wetwell.protocols.modbus.registers import register_csv, register_table
from wetwell.protocols.modbus.server import ModbusServer
from wetwell.services.gateway.daemon import poll_all
from wetwell.services.gateway.survey import read_all

WAIT_S = 20.0
MEASURED = {"level_m": 1.25, "inflow_m3h": 80.5, "pump1_head_m": 9.5, "pump2_power_kw": 7.75, "pump2_running": 1}
has_libmodbus = shutil.which("gcc") is not None and Path("/usr/include/modbus/modbus.h").exists()
needs_libmodbus = pytest.mark.skipif(not has_libmodbus, reason="gcc or libmodbus-dev (Debian) is not installed")

FOREIGN = """
station = "foreign"
host = "127.0.0.1"
port = {port}
period_s = 0.05
answer_timeout_s = 10.0
pumps = 3
clock = "plc"

[signal]
level_m = {{table = "input", address = 300, type = "uint16", unit = "mm"}}
inflow_m3h = {{table = 4, address = 301, type = "int16", scale = 0.1, unit = "L/s"}}
time_s = {{table = "input", address = 306, type = "uint32"}}
heartbeat = {{table = "input", address = 308, type = "uint16"}}
pump1_frequency_hz = {{address = 100}}
pump1_flow_m3h = {{address = 102, word_order = "CDAB"}}
pump1_head_m = {{address = 104, word_order = "BADC"}}
pump1_power_kw = {{address = 106, word_order = "DCBA"}}
pump1_running = {{address = 108, type = "bit", bit = 3}}
pump2_flow_m3h = {{table = "input", address = 304, type = "int32", scale = -0.001}}
pump2_head_m = {{address = 109, type = "int16", no_value = [-32768]}}
pump2_power_kw = {{table = "input", address = 302, type = "uint32", unit = "W"}}
pump2_running = {{table = "coil", address = 12, type = "bit"}}
pump3_running = {{table = 2, address = 20, type = "bit"}}
pump3_power_kw = {{address = 140}}
"""


@pytest.fixture(scope="module")
def libmodbus_plc(tmp_path_factory):
    program = tmp_path_factory.mktemp("libmodbus") / "plc"
    source = Path(__file__).with_name("libmodbus_plc.c")
    flags = ["-Wall", "-Werror", "-I/usr/include/modbus", "-o", program, source, "-lmodbus"]
    subprocess.run(["gcc", *flags], check=True)
    with subprocess.Popen([program], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield int(process.stdout.readline())
        finally:
            process.kill()


async def samples_of(plc, count):
    """The first samples that a gateway publishes of a PLC."""
    bus = MemoryBus()
    subscription = bus.subscribe(sample_key(plc.station))
    polling = asyncio.create_task(poll_all(bus, [plc], 1.0, 0.1))
    samples = []
    try:
        async with asyncio.timeout(WAIT_S):
            while len(samples) < count:
                samples += map(Sample.decode, await subscription.receive())
    finally:
        polling.cancel()
        await asyncio.gather(polling, return_exceptions=True)
    return samples


@needs_libmodbus
def test_libmodbus_with_every_type_and_byte_order(libmodbus_plc, tmp_path):
    file = tmp_path / "plc.toml"
    file.write_text(FOREIGN.format(port=libmodbus_plc))
    (plc,) = load_plcs(file)
    first, *_, last = asyncio.run(samples_of(plc, 5))
    assert (first.seq, last.seq, first.quality) == (0, 4, "good")
    assert first.time == 1_700_000_000 * 10**9
    assert first.level_m == pytest.approx(1.525)
    assert first.inflow_m3h == pytest.approx(-1.8)
    one, two, three = first.pumps
    assert (one.frequency_hz, one.flow_m3h, one.head_m, one.power_kw, one.running) == (
        49.5,
        180.25,
        26.125,
        14.5,
        True,
    )
    assert (two.flow_m3h, two.head_m, two.power_kw, two.running) == (pytest.approx(123.456), None, 14.5, True)
    assert (three.running, three.power_kw) == (False, None), "holding 140 is not there"
    result = asyncio.run(read_all([plc]))["foreign"]
    rows = {row["signal"]: row for row in result["signals"]}
    assert rows["pump3_power_kw"]["refused"] == "holding 140 to 141: refused with exception 02, illegal address"
    assert (rows["level_m"]["words"], rows["level_m"]["value"]) == ("05F5", pytest.approx(1.525))


def own_map(tmp_path, port, more=""):
    (tmp_path / "map.csv").write_text(register_csv(register_table(2, 2)))
    file = tmp_path / "plc.toml"
    settings = f'station = "own"\nhost = "127.0.0.1"\nport = {port}\npumps = 2\nmap = "map.csv"\n'
    file.write_text(f"{settings}answer_timeout_s = 10.0\nconnect_timeout_s = 10.0\n{more}")
    return load_plcs(file)


def check_measured(sample):
    assert (sample.level_m, sample.inflow_m3h) == (1.25, 80.5)
    assert [pump.head_m for pump in sample.pumps] == [9.5, None]
    assert [pump.power_kw for pump in sample.pumps] == [None, 7.75]
    assert [pump.running for pump in sample.pumps] == [False, True]


@pytest.mark.parametrize("word_order", ["ABCD", "CDAB"])
def test_our_own_plc_by_our_own_map(word_order, tmp_path):
    async def scenario():
        server = ModbusServer(
            host="127.0.0.1", port=0, unit_id=9, word_order=word_order, pumps=2, levels=2, on_write=lambda _: None
        )
        async with server:
            server.update(MEASURED)
            (plc,) = own_map(tmp_path, server.port, f'unit_id = 9\nword_order = "{word_order}"\nperiod_s = 0.05\n')
            for sample in await samples_of(plc, 3):
                check_measured(sample)
            (stranger,) = own_map(tmp_path, server.port, "unit_id = 8\n")
            assert "exception 0B" in (await read_all([stranger]))["own"]["error"]

    asyncio.run(scenario())


def test_pymodbustcp(tmp_path):
    bank = DataBank()

    def show(address, *values):
        bank.set_input_registers(address, long_list_to_word([encode_ieee(value) for value in values]))

    nan = float("nan")
    show(0, 1.25, 80.5)
    show(100, nan, nan, 9.5, nan)
    show(120, nan, nan, nan, 7.75)
    bank.set_input_registers(128, [1])
    port = free_port()
    server = ForeignServer("127.0.0.1", port, no_block=True, data_bank=bank)
    server.start()
    try:
        (plc,) = own_map(tmp_path, port, "period_s = 0.05\n")
        for sample in asyncio.run(samples_of(plc, 3)):
            check_measured(sample)
    finally:
        server.stop()


@contextlib.asynccontextmanager
async def tls_in_front(port, context):
    """Port on which TLS is taken off before a PLC that has none."""

    async def pass_on(reader, writer):
        with contextlib.suppress(OSError):
            while data := await reader.read(1024):
                writer.write(data)
        writer.transport.abort()

    connections = set()

    async def serve(reader, writer):
        connections.add(asyncio.current_task())
        plc_reader, plc_writer = await asyncio.open_connection("127.0.0.1", port)
        await asyncio.gather(pass_on(reader, plc_writer), pass_on(plc_reader, writer))

    server = await asyncio.start_server(serve, "127.0.0.1", 0, ssl=context)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        await server.wait_closed()
        await asyncio.gather(*connections)


def test_modbus_over_tls_and_who_is_refused(tmp_path):
    authority, stranger = trustme.CA(), trustme.CA()
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    authority.issue_cert("plc.example").configure_cert(context)
    authority.configure_trust(context)
    context.verify_mode = ssl.CERT_REQUIRED
    for name, ca in (("ca", authority), ("other", stranger)):
        ca.cert_pem.write_to_path(tmp_path / f"{name}.pem")
        client = ca.issue_cert("gateway.example")
        client.private_key_pem.write_to_path(tmp_path / f"{name}.key")
        client.cert_chain_pems[0].write_to_path(tmp_path / f"{name}.crt")

    def tls(ca="ca", own="ca", name="plc.example"):
        shown = f'certificate = "{own}.crt"\nkey = "{own}.key"\n' if own else ""
        return f'period_s = 0.05\n[tls]\nca = "{ca}.pem"\nserver_name = "{name}"\n{shown}'

    async def scenario():
        server = ModbusServer(
            host="127.0.0.1", port=0, unit_id=1, word_order="ABCD", pumps=2, levels=2, on_write=lambda _: None
        )
        async with server, tls_in_front(server.port, context) as port:
            server.update(MEASURED)
            (plc,) = own_map(tmp_path, port, tls())
            check_measured((await samples_of(plc, 1))[0])
            for more, said in (
                (tls(ca="other"), "cannot connect: certificate refused: "),
                (tls(name="other.example"), "cannot connect: certificate refused: Hostname mismatch"),
                (tls(own="other"), "input 0 to 7: connection "),
                (tls(own=""), "input 0 to 7: connection "),
                ("", "input 0 to 7: "),
            ):
                (plc,) = own_map(tmp_path, port, more)
                error = (await read_all([plc]))["own"]["error"]
                assert said in error

    asyncio.run(scenario())
