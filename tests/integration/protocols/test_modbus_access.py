"""Who may write on the Modbus server, and who may connect to it over TLS; the peer is made of sockets, by hand."""

import asyncio
import ipaddress
import logging
import ssl
from pathlib import Path

import pytest
import trustme

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.modbus.server import ModbusServer
from wetwell.protocols.modbus.write_permission import LOOPBACK_WRITES, WritePermission, allowed_registers
from wetwell.protocols.tls import server_context
from wetwell.services.runtime.settings import ModbusSettings, load_settings
from wetwell.services.simulator.daemon import tls_of

WAIT_S = 10.0
WRITE_START_1 = "10 03e8 0002 04 3fc0 0000"
WRITE_STOP_1 = "10 03ea 0002 04 3f00 0000"
WRITE_BOTH = "10 03e8 0004 08 3fc0 0000 3f00 0000"
WRITE_COIL = "05 0000 0000"
READ_LEVEL = "04 0000 0002"


def permit(*registers, client="127.0.0.0/8"):
    return (WritePermission(ipaddress.ip_network(client), registers),)


def make(on_write=lambda _changes: None, **more):
    settings = {"host": "127.0.0.1", "port": 0, "unit_id": 1, "word_order": "ABCD", "pumps": 2, "levels": 2}
    return ModbusServer(**(settings | more), on_write=on_write)


async def exchange(server, pdu, tls=None):
    """Answer to one request, without its header; over TLS where a context is given."""
    body = b"\x01" + bytes.fromhex(pdu)
    async with asyncio.timeout(WAIT_S):
        name = None if tls is None else "127.0.0.1"
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port, ssl=tls, server_hostname=name)
        try:
            writer.write(b"\x00\x01\x00\x00" + len(body).to_bytes(2, "big") + body)
            header = await reader.readexactly(7)
            return await reader.readexactly(int.from_bytes(header[4:6], "big") - 1)
        finally:
            writer.close()


@pytest.mark.parametrize(
    ("permissions", "pdu", "answer"),
    [
        (LOOPBACK_WRITES, WRITE_START_1, "10 03e8 0002"),
        (LOOPBACK_WRITES, WRITE_COIL, "05 0000 0000"),
        ((), WRITE_START_1, "90 01"),
        ((), WRITE_COIL, "85 01"),
        (permit("*", client="192.0.2.0/24"), WRITE_START_1, "90 01"),
        (permit("start_level1_m"), WRITE_START_1, "10 03e8 0002"),
        (permit("start_level1_m"), WRITE_STOP_1, "90 02"),
        (permit("start_level1_m"), WRITE_BOTH, "90 02"),
        (permit("start_level*_m", "stop_level1_m"), WRITE_BOTH, "10 03e8 0004"),
        (permit("start_level1_m"), WRITE_COIL, "85 02"),
        ((), READ_LEVEL, "04 04 3fa0 0000"),
    ],
)
def test_a_write_needs_permission_for_client_and_register(permissions, pdu, answer, caplog):
    written = []

    async def scenario():
        async with make(written.append, write_allow=permissions) as server:
            server.update({"level_m": 1.25})
            return await exchange(server, pdu)

    with caplog.at_level(logging.INFO):
        assert asyncio.run(scenario()) == bytes.fromhex(answer)
    is_write, is_refused = pdu != READ_LEVEL, int(answer[:2], 16) >= 0x80
    assert len(written) == (is_write and not is_refused)
    lines = [record for record in caplog.records if "127.0.0.1" in record.message]
    assert [record.levelno for record in lines] == [logging.WARNING if is_refused else logging.INFO] * is_write


@pytest.mark.parametrize("client", ["127.0.0.1", "127.9.9.9", "::1", "::ffff:127.0.0.1"])
def test_programs_on_this_machine_may_write_by_default(client):
    assert allowed_registers(LOOPBACK_WRITES, client, ["a"]) == {"a"}


@pytest.mark.parametrize("client", ["192.0.2.1", "10.0.0.1", "::ffff:10.0.0.1", "fe80::1%eth0", "0.0.0.0"])
def test_others_may_not(client):
    assert not allowed_registers(LOOPBACK_WRITES, client, ["a"])


def test_a_permission_for_a_register_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match=r"'start_level9_m' .* is no register of this station that can be written"):
        make(write_allow=permit("start_level9_m"))
    with pytest.raises(ValueError, match="'level_m'"):
        make(write_allow=permit("level_m"))


def test_permissions_come_from_the_settings(tmp_path):
    file = tmp_path / "wetwell.toml"
    file.write_text('[[modbus.write_allow]]\nclient = "192.0.2.0/24"\nregisters = ["start_level1_m"]\n')
    (rule,) = load_settings(file).modbus.write_allow
    assert (str(rule.client), rule.registers) == ("192.0.2.0/24", ("start_level1_m",))
    file.write_text('[[modbus.write_allow]]\nclient = "everybody"\nregisters = ["*"]\n')
    with pytest.raises(ConfigError, match=r"modbus\.write_allow\[1\]\.client: got 'everybody'"):
        load_settings(file)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Certificates of the site's authority, and of another one."""
    folder = tmp_path_factory.mktemp("modbus-tls")
    for authority_name, names in (("ca", ("127.0.0.1", "scada")), ("other-ca", ("stranger",))):
        authority = trustme.CA()
        authority.cert_pem.write_to_path(str(folder / f"{authority_name}.pem"))
        for name in names:
            issued = authority.issue_cert(name)
            issued.private_key_pem.write_to_path(str(folder / f"{name}.key"))
            issued.cert_chain_pems[0].write_to_path(str(folder / f"{name}.pem"))
    return folder


def server_tls(folder, *, is_mutual=True):
    ca = folder / "ca.pem" if is_mutual else None
    return server_context(folder / "127.0.0.1.pem", folder / "127.0.0.1.key", ca, "Modbus TCP")


def client_tls(folder, name=None, ca="ca.pem"):
    context = ssl.create_default_context(cafile=folder / ca)
    if name is not None:
        context.load_cert_chain(folder / f"{name}.pem", folder / f"{name}.key")
    return context


@pytest.mark.parametrize(("is_mutual", "name"), [(True, "scada"), (False, None)])
def test_modbus_over_tls_reads_and_writes(folder, is_mutual, name):
    async def scenario():
        async with make(tls=server_tls(folder, is_mutual=is_mutual)) as server:
            server.update({"level_m": 1.25})
            context = client_tls(folder, name)
            return await exchange(server, READ_LEVEL, context), await exchange(server, WRITE_START_1, context)

    assert asyncio.run(scenario()) == (bytes.fromhex("04 04 3fa0 0000"), bytes.fromhex("10 03e8 0002"))


@pytest.mark.parametrize(
    ("name", "ca", "told"),
    [
        (None, "ca.pem", "peer did not return a certificate"),
        ("stranger", "ca.pem", "certificate verify failed"),
        ("scada", "other-ca.pem", None),  # it refuses the server, and hangs up
    ],
)
def test_wrong_certificate_is_refused_and_logged(folder, name, ca, told, caplog):
    async def scenario():
        async with make(tls=server_tls(folder)) as server:
            with pytest.raises((OSError, asyncio.IncompleteReadError)):
                await exchange(server, READ_LEVEL, client_tls(folder, name, ca))
            assert server.clients == 0
            return await exchange(server, READ_LEVEL, client_tls(folder, "scada"))

    with caplog.at_level(logging.WARNING):
        assert asyncio.run(scenario())[:2] == b"\x04\x04"
    assert told is None or f"Modbus TCP: a client is refused: {told}" in caplog.messages[0]


def test_plain_modbus_is_not_served_where_tls_is_set(folder):
    async def scenario():
        async with make(tls=server_tls(folder)) as server:
            with pytest.raises((OSError, asyncio.IncompleteReadError)):
                await exchange(server, READ_LEVEL)

    asyncio.run(scenario())


def test_what_is_wrong_with_the_files_is_told(folder):
    with pytest.raises(ConfigError, match=r"none\.pem: cannot be read"):
        server_context(folder / "none.pem", folder / "scada.key", None, "Modbus TCP")
    with pytest.raises(ConfigError, match="no certificate and key that fit"):
        server_context(folder / "scada.pem", folder / "stranger.key", None, "Modbus TCP")
    with pytest.raises(ConfigError, match="are both needed"):
        tls_of(ModbusSettings.model_validate({"tls": {"certificate": folder / "scada.pem"}}))


def test_modbus_for_all_is_warned_of(caplog):
    assert tls_of(ModbusSettings(host="0.0.0.0")) is None
    assert "whoever reaches it may read" in caplog.text
