"""The register table, pure."""

import csv
import io
import math

import pytest

from wetwell.protocols.modbus.registers import (
    MAX_PUMPS,
    Register,
    decode,
    encode,
    measured_words,
    register_csv,
    register_table,
)
from wetwell.protocols.quantities import columns_of

TABLES = ("coil", "holding", "input")


def row(name: str, table: str = "holding") -> Register:
    return next(row for row in register_table(2, 2) if (row.name, row.table) == (name, table))


@pytest.mark.parametrize(("pumps", "levels"), [(1, 1), (3, 2), (MAX_PUMPS, MAX_PUMPS)])
@pytest.mark.parametrize("table", TABLES)
def test_registers_of_a_table_do_not_overlap(table, pumps, levels):
    taken = [
        address
        for row in register_table(pumps, levels)
        if row.table == table
        for address in range(row.address, row.address + row.count)
    ]
    assert taken
    assert len(taken) == len(set(taken))
    assert min(taken) >= 0
    assert max(taken) <= 0xFFFF


@pytest.mark.parametrize("table", TABLES)
def test_names_are_unique_within_a_table(table):
    names = [row.name for row in register_table(MAX_PUMPS, MAX_PUMPS) if row.table == table]
    assert len(names) == len(set(names))


def test_measured_values_have_the_same_addresses_in_both_tables():
    rows = register_table(3, 2)
    served = {
        table: {
            (row.name, row.address, row.count, row.type) for row in rows if (row.table, row.access) == (table, "r")
        }
        for table in ("input", "holding")
    }
    assert served["input"] == served["holding"]
    assert max(row.address + row.count for row in rows if row.table == "input") <= measured_words(3)


def test_names_are_the_recording_columns_and_the_settings():
    rows = register_table(2, 1)
    assert {row.name for row in rows if row.table == "input"} == {*columns_of(2)} | {"heartbeat", "time_s"}
    writable = {(row.name, row.table) for row in rows if row.access == "rw"}
    assert writable == {
        ("start_level1_m", "holding"),
        ("stop_level1_m", "holding"),
        ("pump1_auto", "coil"),
        ("pump2_auto", "coil"),
    }


def test_addresses_stay_where_clients_know_them():
    assert row("level_m").address == 0
    assert row("heartbeat").address == 4
    assert row("pump2_head_m").address == 124
    assert row("stop_level2_m").address == 1006
    assert row("pump2_auto", "coil").address == 1


@pytest.mark.parametrize(("pumps", "levels", "name"), [(0, 1, "pumps"), (33, 1, "pumps"), (1, 0, "levels")])
def test_a_size_out_of_range_is_refused(pumps, levels, name):
    with pytest.raises(ValueError, match=rf"{name} must lie in \[1, 32\]"):
        register_table(pumps, levels)


def test_known_words():
    assert encode(row("level_m"), 123456.0, "ABCD") == [0x47F1, 0x2000]
    assert encode(row("level_m"), 123456.0, "CDAB") == [0x2000, 0x47F1]
    assert encode(row("time_s"), 0x1234_5678, "ABCD") == [0x1234, 0x5678]
    assert encode(row("time_s"), 0x1234_5678, "CDAB") == [0x5678, 0x1234]
    assert encode(row("heartbeat"), 65535, "CDAB") == [65535]


@pytest.mark.parametrize("missing", [None, math.nan, math.inf, -math.inf])
def test_no_value_is_nan_or_zero(missing):
    assert encode(row("level_m"), missing, "ABCD") == [0x7FC0, 0]
    assert encode(row("pump1_running"), missing, "ABCD") == [0]
    assert encode(row("time_s"), missing, "ABCD") == [0, 0]
    assert decode(row("level_m"), [0x7F80, 0], "ABCD") is None


@pytest.mark.parametrize(
    ("name", "table", "value", "rule"),
    [
        ("heartbeat", "holding", 65536, r"heartbeat must be a whole number in \[0, 65535\], got 65536"),
        ("heartbeat", "holding", -1, r"heartbeat must be a whole number in \[0, 65535\], got -1"),
        ("time_s", "holding", 2.0**32, r"time_s must be a whole number in \[0, 4294967295\]"),
        ("pump1_running", "holding", 0.5, r"pump1_running must be a whole number"),
        ("pump1_auto", "coil", 2, r"pump1_auto must be a whole number in \[0, 1\], got 2"),
        ("level_m", "holding", 1e39, r"level_m must fit a 32-bit float"),
    ],
)
def test_a_value_that_does_not_fit_names_register_and_rule(name, table, value, rule):
    with pytest.raises(ValueError, match=rule):
        encode(row(name, table), value, "ABCD")


def test_half_a_value_is_not_decoded():
    with pytest.raises(ValueError, match="level_m has 2 words, got 1"):
        decode(row("level_m"), [0], "ABCD")


def test_csv_has_the_columns_and_a_row_a_register():
    rows = register_table(2, 2)
    read = list(csv.DictReader(io.StringIO(register_csv(rows))))
    assert list(read[0]) == ["name", "table", "address", "count", "type", "unit", "access", "description"]
    assert [(line["name"], line["table"], int(line["address"])) for line in read] == [
        (row.name, row.table, row.address) for row in rows
    ]
    assert all(line["description"] for line in read)
