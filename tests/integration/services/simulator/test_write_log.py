"""Writes over Modbus: those that change something and those that are refused are in the audit; a gateway has none."""

import asyncio
import ipaddress
import json
from pathlib import Path

import pytest
from pymodbus.client import AsyncModbusTcpClient

from wetwell.protocols.modbus.client import Question
from wetwell.protocols.modbus.registers import register_table
from wetwell.protocols.modbus.server import ModbusServer
from wetwell.protocols.modbus.write_permission import LOOPBACK_WRITES, WritePermission
from wetwell.services.security.audit import audit_in
from wetwell.services.simulator.write_log import WriteLog

ROOT = Path(__file__).parents[4]
ADDRESS = next(row.address for row in register_table(2, 2) if row.name == "start_level1_m")
ONE_AND_A_HALF, TWO = [0x3FC0, 0], [0x4000, 0]


def refuse_two(changes):
    if 2.0 in changes.values():
        raise ValueError("start_level1_m must be less than 2, got 2")


def written(audit, writes, write_allow=LOOPBACK_WRITES):
    """Lines of the audit after writes to the first start level."""

    async def run():
        server = ModbusServer(
            host="127.0.0.1",
            port=0,
            unit_id=1,
            word_order="ABCD",
            pumps=2,
            levels=2,
            on_write=refuse_two,
            witness=WriteLog(audit, "alpha").note,
            write_allow=write_allow,
        )
        async with server, AsyncModbusTcpClient("127.0.0.1", port=server.port) as client:
            for words in writes:
                await client.write_registers(ADDRESS, words, device_id=1)
            await client.read_holding_registers(ADDRESS, count=2, device_id=1)

    asyncio.run(run())
    lines = [json.loads(line) for line in audit.path.read_text().splitlines()]
    assert {(line["act"], line["station"], line["address"]) for line in lines} == {
        ("modbus write", "alpha", "127.0.0.1")
    }
    return [(line["values"], line.get("refused")) for line in lines]


def test_writes_that_change_something_and_those_that_the_plc_refuses_are_written_down(tmp_path):
    lines = written(audit_in(tmp_path, "simulator"), [ONE_AND_A_HALF, ONE_AND_A_HALF, TWO])
    assert lines == [
        ({"start_level1_m": 1.5}, None),
        ({"start_level1_m": 2.0}, "start_level1_m must be less than 2, got 2"),
    ]


@pytest.mark.parametrize(
    ("client", "line"),
    [
        ("192.0.2.0/24", ({}, "may write nothing")),
        ("127.0.0.0/8", ({"start_level1_m": 1.5}, "may not write start_level1_m")),
    ],
)
def test_a_client_that_may_not_write_does_not_fill_the_disk(tmp_path, client, line):
    permission = WritePermission(ipaddress.ip_network(client), ("stop_level1_m",))
    lines = written(audit_in(tmp_path, "simulator"), [ONE_AND_A_HALF] * 30, (permission,))
    assert lines == [line] * 11


@pytest.mark.parametrize(("table", "function"), [("coil", 1), ("discrete", 2), ("holding", 3), ("input", 4)])
def test_a_gateway_has_no_question_that_writes(table, function):
    assert Question(1, 1, table, 0, 1).encode()[7] == function


def test_no_client_of_modbus_but_that_of_questions_is_in_the_product():
    packages = ("protocols", "simulator", "detector", "sim2real", "services")
    users = {
        path.relative_to(ROOT).as_posix()
        for package in packages
        for path in (ROOT / package).rglob("*.py")
        if "pymodbus" in path.read_text(encoding="utf-8")
    }
    code = "".join((ROOT / user).read_text(encoding="utf-8") for user in users - {"protocols/modbus/server.py"})
    assert "protocols/modbus/client.py" in users
    assert "Write" not in code
    assert "pymodbus.client" not in code
