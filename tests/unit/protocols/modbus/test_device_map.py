"""Files of PLCs: what they mean, and one line for what is wrong with them."""

import math
import struct
from pathlib import Path

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.modbus.block_reads import halves, plan_blocks
from wetwell.protocols.modbus.device_csv import read_map_csv
from wetwell.protocols.modbus.device_map import load_plcs
from wetwell.protocols.modbus.device_signal import Signal
from wetwell.protocols.modbus.registers import decode, encode, register_csv, register_table
from wetwell.services import gateway
from wetwell.services.gateway.survey import described

PLC = 'station = "s"\nhost = "h"\n'
LEVEL = "[signal.level_m]\naddress = 0\n"


def load(tmp_path, text):
    file = tmp_path / "plc.toml"
    file.write_text(text)
    return load_plcs(file)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PLC, "plc.toml: station 's': signal: missing, give a map or [signal] tables"),
        ('host = "h"\n' + LEVEL, "plc.toml: station: missing, give station or station_file"),
        (PLC + "prot = 502\n" + LEVEL, "plc.toml: prot: unknown key"),
        (PLC + "port = 0\n" + LEVEL, "plc.toml: port: got 0, input should be greater than or equal to 1"),
        (
            PLC + "max_words = 126\n" + LEVEL,
            "plc.toml: max_words: got 126, input should be less than or equal to 125",
        ),
        (PLC + "[signal.level_m]\n", "plc.toml: signal.level_m.address: missing"),
        (
            PLC + "[signal.levle_m]\naddress = 0\n",
            "plc.toml: signal.levle_m: is no signal, must be level_m, inflow_m",
        ),
        (PLC + LEVEL + 'unit = "L/s"\n', "plc.toml: signal.level_m.unit: got 'L/s', must be one of m, cm, mm, ft"),
        (
            PLC + LEVEL + 'type = "float64"\n',
            "plc.toml: signal.level_m.type: got 'float64', input should be 'float32'",
        ),
        (PLC + LEVEL + 'table = "coil"\n', "plc.toml: signal.level_m: type: got 'float32', a coil is of type 'bit'"),
        (PLC + LEVEL + "table = 5\n", "plc.toml: signal.level_m.table: got 5, input should be 'coil', 'discrete'"),
        (
            PLC + LEVEL + "bit = 3\n",
            "plc.toml: signal.level_m: bit: is needed for type 'bit' in a table of words, an",
        ),
        (PLC + LEVEL + "scale = 0\n", "plc.toml: signal.level_m: scale: got 0, must not be 0"),
        (
            PLC + LEVEL + 'unit = "%"\n',
            "plc.toml: signal.level_m: span: [value at 0 %, value at 100 %] is needed for",
        ),
        (
            PLC + "[signal.level_m]\naddress = 65535\n",
            "plc.toml: signal.level_m: address: got 65535, its last word lies",
        ),
        (PLC + "pumps = 1\n[signal.pump2_head_m]\naddress = 0\n", "signal.pump2_head_m: the station has 1 pumps"),
        (PLC + 'clock = "plc"\n' + LEVEL, "plc.toml: station 's': clock: got 'plc', needs the signal time_s"),
        (PLC + 'map = "no.csv"\n', "no.csv: cannot be read: No such file or directory"),
        ('station_file = "no.toml"\nhost = "h"\n' + LEVEL, "no.toml: cannot be read: No such file or directory"),
        (PLC + 'tls.ca = "no.pem"\n' + LEVEL, "plc.toml: station 's': tls.ca: got 'no.pem', is no file"),
        (PLC + 'tls.ca = "plc.toml"\n' + LEVEL, "plc.toml: station 's': tls: the files hold no certificate or key"),
        (PLC + 'tls = {ca = "a", key = "b"}\n' + LEVEL, "plc.toml: tls: certificate and key: give both or none"),
        ("plc = []\n", "plc.toml: plc: got [], "),
        (
            '[[plc]]\nstation = "s"\nhost = "h"\nsignal.level_m.address = 0\n' * 2,
            "plc.toml: station 's': has two PLCs, must have one",
        ),
        (
            '[[plc]]\nstation = "s"\nhost = "h"\nsignal.level_m.address = -1\n',
            "plc.toml: plc[1].signal.level_m.address: got -1, input should be greater than or equal to 0",
        ),
    ],
)
def test_an_error_is_one_line_with_file_key_value_and_rule(text, said, tmp_path):
    with pytest.raises(ConfigError) as error:
        load(tmp_path, text)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name,table,type\n", "map.csv: column 'address' is missing"),
        ("name,table,address,type,colour\n", "map.csv: column 'colour' is not known"),
        (
            "name,table,address,type\nlevel_m,input,x,float32\n",
            "map.csv: line 2: level_m: address: got 'x', input sho",
        ),
        ("name,table,address,type\nlevle_m,input,0,float32\n", "map.csv: line 2: signal.levle_m: is no signal"),
        ('name,table,address,type\nlevel_m,input,0,"float', "map.csv: is no CSV in UTF-8: unexpected end of data"),
        ("name,table,address,type\npump3_head_m,input,0,float32\n", "line 2: signal.pump3_head_m: the station has 2"),
    ],
)
def test_an_error_in_a_csv_names_its_line(text, said, tmp_path):
    file = tmp_path / "map.csv"
    file.write_text(text)
    with pytest.raises(ConfigError) as error:
        read_map_csv(file, 2)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("word_order", ["ABCD", "CDAB"])
def test_the_projects_own_map_is_a_map_as_it_is(word_order, tmp_path):
    table = register_table(3, 3)
    (tmp_path / "map.csv").write_text(register_csv(table))
    text = f'station = "alpha"\nhost = "h"\npumps = 3\nmap = "map.csv"\nword_order = "{word_order}"\n'
    (plc,) = load(tmp_path, text)
    measured = {row.name: row for row in table if row.table == "input"}
    assert plc.signals.keys() == measured.keys()
    for name, row in measured.items():
        signal = plc.signals[name]
        assert (signal.table, signal.address, signal.count) == ("input", row.address, row.count)
        for value in (0.0, 1.0, 49.5, None):
            if row.type == "float32" or value in {0.0, 1.0}:
                words = encode(row, value, word_order)
                assert signal.value(words, plc.device.word_order, row.unit) == decode(row, words, word_order)
    blocks = plan_blocks(plc.signals, plc.device.max_gap, plc.device.max_words)
    assert [(block.table, block.address, block.count) for block in blocks] == [("input", 0, 8), ("input", 100, 49)]


def test_a_csv_of_a_foreign_plc_and_a_signal_that_overrules_it(tmp_path):
    (tmp_path / "map.csv").write_text(
        "name,table,address,type,unit,scale,offset,word_order,bit,no_value,description\n"
        "level_m,4,10,int16,cm,0.1,5,,,-32768 32767,Radar\n"
        "pump1_running,3,20,bit,,,,,3,,Status word\n"
        "pump2_power_kw,holding,30,uint32,W,,,CDAB,,,\n"
        "heartbeat,2,7,bit,,,,,,,\n"
    )
    (plc,) = load(tmp_path, PLC + 'map = "map.csv"\n[signal.heartbeat]\ntable = 1\naddress = 9\ntype = "bit"\n')
    assert plc.pumps == 2, "without a station file the map tells the number"
    level, running = plc.signals["level_m"], plc.signals["pump1_running"]
    assert level.value([1000], "ABCD", "m") == pytest.approx(1.05)
    assert level.value([0x8000], "ABCD", "m") is None
    assert [running.value([word], "ABCD", "") for word in (0b1000, 0b10111)] == [1.0, 0.0]
    assert plc.signals["pump2_power_kw"].value([7500, 0], "ABCD", "kW") == 7.5
    assert (plc.signals["heartbeat"].table, plc.signals["heartbeat"].address) == ("coil", 9)


@pytest.mark.parametrize(("order", "sent"), [("ABCD", "ABCD"), ("CDAB", "CDAB"), ("BADC", "BADC"), ("DCBA", "DCBA")])
def test_bytes_arrive_in_any_order(order, sent):
    packed = dict(zip("ABCD", struct.pack(">f", -123.625), strict=True))
    words = struct.unpack(">HH", bytes(packed[letter] for letter in sent))
    assert Signal(address=0).raw(words, order) == -123.625
    other = "ABCD" if order != "ABCD" else "DCBA"
    assert Signal(address=0, word_order=order).raw(words, other) == -123.625, "a signal's own order counts"


@pytest.mark.parametrize(
    ("unit", "house", "value"),
    [
        ("cm", "m", 0.02),
        ("bar", "m", 2e5 / 9810.0),
        ("kPa", "m", 2e3 / 9810.0),
        ("L/s", "m³/h", 7.2),
        ("m³/s", "m³/h", 7200.0),
        ("gpm", "m³/h", 2 * 3.785411784 * 0.06),
        ("W", "kW", 0.002),
        ("", "m", 2.0),
    ],
)
def test_units_are_turned_into_those_of_the_house(unit, house, value):
    assert Signal(address=0, type="uint16", unit=unit).value([2], "ABCD", house) == pytest.approx(value, rel=1e-6)


def test_percent_goes_over_a_span():
    level = Signal(address=0, type="uint16", unit="%", scale=0.01, span=(0.5, 4.5))
    assert level.value([2500], "ABCD", "m") == pytest.approx(1.5)


def test_what_is_beyond_numbers_is_no_value():
    largest = struct.unpack(">HH", struct.pack(">f", 3e38))
    assert Signal(address=0, scale=1e300).value(largest, "ABCD", "m") is None
    assert Signal(address=0).raw([0x7FC0, 0], "ABCD") is None
    assert not math.isnan(Signal(address=0).raw([0, 1], "ABCD"))


def signals_at(*addresses, **settings):
    return {f"pump{n}_head_m": Signal(address=at, **settings) for n, at in enumerate(addresses, start=1)}


def test_blocks_end_at_gaps_and_at_the_most_words():
    def planned(signals, max_gap=16, max_words=125):
        return [(block.address, block.count) for block in plan_blocks(signals, max_gap, max_words)]

    assert planned(signals_at(0, 18)) == [(0, 20)]
    assert planned(signals_at(0, 19)) == [(0, 2), (19, 2)]
    assert planned(signals_at(0, 2, 4), max_gap=0, max_words=4) == [(0, 4), (4, 2)]
    assert planned(signals_at(4, 2, 0), max_gap=0) == [(0, 6)]
    assert planned(signals_at(*range(0, 300, 2))) == [(0, 124), (124, 124), (248, 52)]
    assert planned(signals_at(5, 5, type="bit", bit=1)) == [(5, 1)]
    assert planned(signals_at(0, 1999, table="coil", type="bit"), max_gap=124) == [(0, 1), (1999, 1)]


def test_a_block_is_halved_down_to_its_signals():
    signals = signals_at(0, 2, 10)
    (block,) = plan_blocks(signals, 16, 125)
    first, second = halves(block, signals)
    assert [(half.address, half.count) for half in (first, second)] == [(0, 2), (2, 10)]
    assert halves(first, signals) == ()
    assert [(half.address, half.count) for half in halves(second, signals)] == [(2, 2), (10, 2)]
    assert second.words_of(signals["pump3_head_m"], list(range(10))) == [8, 9]


def test_the_example_is_a_valid_file():
    harbour, mill_lane = load_plcs(Path(gateway.__file__).with_name("example.toml"))
    assert (harbour.station, harbour.pumps, mill_lane.station, mill_lane.pumps) == ("harbour", 2, "mill-lane", 1)
    assert harbour.signals["level_m"].value([5000], "CDAB", "m") == pytest.approx(2.8)
    assert mill_lane.signals["pump1_head_m"].value([1101], "ABCD", "m") == pytest.approx((110.1 - 12.0) / 9.81)
    assert described(mill_lane)["not_in_the_map"] == "inflow_m3h, heartbeat, pump1_frequency_hz, pump1_power_kw"
    assert [request["count"] for request in described(harbour)["requests"]] == [31, 10]
