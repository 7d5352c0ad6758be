"""The command line: a user's error is one line on standard error and exit code 2, and nothing half written."""

import json
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.inflow import INFLOWS

STATION = 'name = "s"\nsump.area_m2 = 8.0\npump = [{curve = [36.0, -0.02, -1.0e-4]}]\n'


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["station", "check", "{station}"], "{station}: sump.area_m2: got -8.0, input should be greater than 0"),
        (["station", "check", "nowhere.toml"], "nowhere.toml: cannot be read: No such file or directory"),
        (["station", "check", "nosuch"], "station 'nosuch' is neither a file nor one of alpha"),
        (
            ["simulate", "--station", "alpha", "--out", "{tmp}/x.txt"],
            "{tmp}/x.txt: a recording ends in one of .csv, .csv.gz, .parquet",
        ),
        (
            ["simulate", "--station", "alpha", "--out", "{tmp}/no/x.csv"],
            "{tmp}/no/x.csv: cannot be written: No such file or directory",
        ),
        (
            ["simulate", "--station", "alpha", "--out", "{tmp}/x.csv", "--days", "-1"],
            "--days: got -1, must be positive",
        ),
        (
            ["simulate", "--station", "alpha", "--out", "{tmp}/x.csv", "--scenario", "{scenario}"],
            "scenario 'wrong': fault[1].pump: got 9, station 'alpha' has 3 pumps",
        ),
        (
            ["simulate", "--out", "{tmp}/x.csv", "--station", "{effect}"],
            "{effect}: station 's': effect[1]: input tag 'worn_valve' found using 'name'",
        ),
        (["station", "check", "{effect}"], "{effect}: station 's': effect[1]: input tag 'worn_valve'"),
        (
            ["station", "check", "{levels}"],
            "{levels}: station 's': effect[1]: threshold_shift: with start_m = -1.2, stop_m = 0: stop_levels_m[1]",
        ),
        (
            ["detect", "--station", "alpha", "--recording", "{tmp}/no.csv", "--out", "{tmp}/v"],
            "{tmp}/no.csv: cannot be read: No such file",
        ),
        (
            ["detect", "--station", "alpha", "--recording", "{bad}", "--out", "{tmp}/v"],
            "{bad}: column 'pump1_flow_m3h', row 2: CSV conv",
        ),
        (["convert", "{bad}", "--out", "{tmp}/v.csv"], "{bad}: column 'datetime' is missing, is this a SKAB file?"),
        (["convert", "{bad}"], "convert: give --mapping FILE and --out FILE, or --draft FILE"),
        (
            ["convert", "{bad}", "{bad}", "--out", "{tmp}/v.csv"],
            "convert: got 2 files, without --mapping it takes one",
        ),
        (["convert", "{bad}", "--draft", "{settings}"], "--draft: {settings} is there already, give another name"),
        (
            ["convert", "{bad}", "--mapping", "{settings}", "--out", "{tmp}/v.csv"],
            "{settings}: modbus: unknown key",
        ),
        (
            ["convert", "{bad}", "--mapping", "{mapping}", "--out", "{tmp}/v.csv"],
            "{mapping}: time_zone: missing, the stamp of {bad}, line 2, has no offset",
        ),
        (
            ["convert", "{bad}", "--mapping", "{mapping}", "--out", "{tmp}/v.csv", "--station", "alpha"],
            "{mapping}: station: got 'north', the station file is of 'alpha'",
        ),
        (
            ["convert", "{bad}", "--mapping", "{pumps}", "--out", "{tmp}/v.csv", "--station", "alpha"],
            "{pumps}: signal: got pump 4, station 'alpha' has 3",
        ),
        (["convert", "{tmp}/no.csv", "--draft", "{tmp}/m.toml"], "{tmp}/no.csv: cannot be read: No such file"),
        (["up", "--for", "soon"], "--for: got 'soon', must be a time such as 90s, 10m or 2h"),
        (["up", "--modbus", "here"], "--modbus: got 'here', must be HOST:PORT such as 127.0.0.1:5020"),
        (["up", "--page", "here"], "--page: got 'here', must be HOST:PORT such as 127.0.0.1:8080"),
        (
            ["dashboard", "--page", "0.0.0.0:80"],
            "dashboard.host: refuses to listen on 0.0.0.0, where others reach it",
        ),
        (["up", "--zenoh", "udp"], "settings: zenoh.endpoint: got 'udp', string should match pattern"),
        (
            ["export", "--station", "alpha", "--data", "{tmp}/no", "--out", "{tmp}/x.csv"],
            "historian.folder: {tmp}/no: there is no history",
        ),
        (
            ["export", "--station", "alpha", "--from", "soon", "--out", "{tmp}/x.csv"],
            "--from: got 'soon', must be ISO 8601 such as 2025-01",
        ),
        (["history", "--last", "ever"], "--last: got 'ever', must be a time such as 90s, 10m or 2h"),
        (["config", "check", "{settings}"], "{settings}: modbus.prot: unknown key"),
    ],
)
def test_an_error_is_one_line(
    arguments: list[str],
    said: str,
    run_wetwell: Callable[..., int],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    files = {
        "station": STATION.replace("8.0", "-8.0"),
        "effect": STATION + '[[effect]]\nname = "worn_valve"\n',
        "levels": STATION + '[[effect]]\nname = "threshold_shift"\nstart_m = -1.2\n',
        "scenario": 'name = "wrong"\n[[fault]]\nkind = "blockage"\npump = 9\nstart_s = 1\nend_s = 2\n',
        "bad": "time,pump1_flow_m3h\n2025-01-01,1\n2025-01-01,abc\n",
        "settings": "[modbus]\nprot = 1\n",
        "mapping": 'station = "north"\nlayout = "wide"\ncolumns.time = "time"\n'
        'signal.pump1_flow_m3h.tag = "pump1_flow_m3h"\n',
        "pumps": 'station = "alpha"\nlayout = "wide"\ncolumns.time = "time"\nsignal.pump4_flow_m3h.tag = "x"\n',
    }
    paths = {name: tmp_path / f"{name}.{'csv' if name == 'bad' else 'toml'}" for name in files}
    for name, text in files.items():
        paths[name].write_text(text)
    names = {"tmp": tmp_path, **paths}
    before = sorted(tmp_path.iterdir())
    assert run_wetwell(*(argument.format(**names) for argument in arguments)) == 2
    printed = capsys.readouterr()
    assert printed.err.splitlines()[-1].startswith("wetwell: " + said.format(**names))
    assert "Traceback" not in printed.err
    assert printed.out == ""
    assert sorted(tmp_path.iterdir()) == before


FLAT = STATION.replace("36.0", "20.0") + "rising_main.static_head_m = "
NO_DUTY = "station 's': pump[1]: curve does not meet the system curve: shut-off head"
BAD_STATIONS = {
    "no lift left": (FLAT + "20.0", "pump[1]: shut-off head 20 m must exceed rising_main.static_head_m = 20 m"),
    "hardly any lift left": (
        FLAT + "19.9",
        f"{NO_DUTY} 20 m must exceed the static head of 19.9 m, effects included, by 1%",
    ),
    "no lift left by an effect": (
        FLAT + '15.0\n[[effect]]\nname = "static_head_bias"\noffset_m = 6.0',
        f"{NO_DUTY} 20 m must exceed the static head of 21 m, effects included",
    ),
    "no lift left by wear": (
        FLAT + '13.0\n[[effect]]\nname = "pump_wear"\nhead_loss = 0.4',
        f"{NO_DUTY} 12 m must exceed the static head of 13 m",
    ),
    "stop at start": (
        STATION + "control = {start_levels_m = [1.0], stop_levels_m = [1.0]}",
        "control: stop_levels_m[1] = 1 must lie under start_levels_m[1] = 1",
    ),
    "stop under the floor": (
        STATION + "control = {start_levels_m = [1.0], stop_levels_m = [-0.1]}",
        "station 's': control.stop_levels_m[1] = -0.1 lies under the floor: the pump would never stop",
    ),
    "overflow at start": (
        STATION + "sump.overflow_level_m = 1.6",
        "station 's': sump.overflow_level_m: got 1.6, must lie over control.start_levels_m[1] = 1.6, or the wet well",
    ),
    "area falls to zero": (
        STATION + "sump.profile = [[0.0, 8.0], [2.0, 0.0]]",
        "sump.profile[2][2]: got 0.0, input should be greater than 0",
    ),
}


@pytest.mark.parametrize(("text", "said"), BAD_STATIONS.values(), ids=BAD_STATIONS)
@pytest.mark.parametrize(
    "command",
    [
        ["station", "check", "{station}"],
        ["station", "show", "{station}"],
        ["simulate", "--out", "{tmp}/x.csv", "--station", "{station}"],
        ["dataset", "--out", "{tmp}/set", "--station", "{station}"],
        ["up", "--station", "{station}"],
        ["simulator", "--station", "{station}"],
        ["plc", "--station", "{station}"],
        ["detector", "--station", "{station}"],
        ["validate", "--recording", "{station}", "--station", "{station}"],
    ],
    ids=" ".join,
)
def test_a_station_that_cannot_work_is_refused_at_every_start(
    command: list[str],
    text: str,
    said: str,
    run_wetwell: Callable[..., int],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    station = tmp_path / "station.toml"
    station.write_text(text)
    assert run_wetwell(*(argument.format(station=station, tmp=tmp_path) for argument in command)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"wetwell: {station}: ")
    assert said in line
    assert list(tmp_path.iterdir()) == [station]


def test_wrong_flags_end_with_2(run_wetwell: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    assert run_wetwell("simulate", "--nosuch") == 2
    assert "--nosuch" in capsys.readouterr().err


def test_simulate_then_detect(
    run_wetwell: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, verdicts = tmp_path / "r.parquet", tmp_path / "v.jsonl"
    assert run_wetwell("simulate", "--station", "alpha", "--days", "0.05", "--out", recording, "--json") == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 4320
    command = ("detect", "--station", "alpha", "--recording", recording, "--out", verdicts, "--json")
    assert run_wetwell(*command, "--html", tmp_path / "episodes.html") == 0
    summary = json.loads(capsys.readouterr().out)
    lines = [json.loads(line) for line in verdicts.read_text().splitlines()]
    assert summary["counts"]["samples"] == 4320
    assert summary["verdicts"] == {"learning": len(lines)}
    assert summary["episodes"] == []
    assert "No fault was told." in (tmp_path / "episodes.html").read_text()
    assert {line["pump"] for line in lines} == {1, 2, 3}
    assert all(line["schema"] == "wetwell.verdict/1" and line["station"] == "alpha" for line in lines)


def test_modbus_map_is_csv(run_wetwell: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    assert run_wetwell("modbus-map", "--format", "csv") == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert head == "name,table,address,count,type,unit,access,description"
    assert any(row.startswith("pump3_head_m,input,") for row in rows)


def test_effects_lists_the_registry(run_wetwell: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    assert run_wetwell("effects", "--json") == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["effects"]}
    assert list(rows) == list(EFFECTS)
    assert rows["motor_slip"]["component"] == "drive"
    assert rows["motor_slip"]["parameters"] == [
        {"name": "slip", "unit": "1", "low": 0.0, "high": 0.15, "neutral": 0.0},
        {"name": "power_exponent", "unit": "1", "low": 0.0, "high": 5.0, "default": 0.0, "neutral": 0.0},
    ]
    assert run_wetwell("effects") == 0
    assert "motor_slip (drive)\n  An asynchronous motor" in capsys.readouterr().out


def test_faults_and_inflows_list_their_registries(
    run_wetwell: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_wetwell("faults", "--json") == 0
    rows = {row["kind"]: row for row in json.loads(capsys.readouterr().out)["faults"]}
    assert list(rows) == list(FAULTS)
    assert rows["impeller_wear"]["parameters"][-1] == {"name": "head_loss", "default": 0.15, "range": ">= 0, < 1"}
    assert rows["drive_trip"]["summary"].startswith("Thermal or earth-fault protection")
    assert run_wetwell("inflows", "--json") == 0
    assert [row["kind"] for row in json.loads(capsys.readouterr().out)["inflows"]] == list(INFLOWS)
    assert run_wetwell("faults") == 0
    assert "  shape: step (step, intermittent)\n" in capsys.readouterr().out
    assert run_wetwell("inflows") == 0
    assert "  time_s: must be given\n" in capsys.readouterr().out


def test_station_show_gives_the_duty_points(
    run_wetwell: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_wetwell("station", "show", "alpha", "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["each_pump_alone"][0]["flow_m3h"] == pytest.approx(200.0, abs=0.01)
    assert shown["total_flow_m3h"] == pytest.approx(600.0, abs=0.03)


def test_a_file_of_plcs_is_checked_and_a_plc_that_is_away_is_told(
    run_wetwell: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_wetwell("modbus-map") == 0
    (tmp_path / "map.csv").write_text(capsys.readouterr().out)
    file = tmp_path / "plc.toml"
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))  # and does not listen
        file.write_text(f'station = "s"\nhost = "127.0.0.1"\nport = {deaf.getsockname()[1]}\nmap = "map.csv"\n')
        assert run_wetwell("gateway", "check", file, "--json") == 0
        shown = json.loads(capsys.readouterr().out)["s"]
        assert (shown["pumps"], len(shown["signals"]), shown["not_in_the_map"]) == (3, 19, "")
        assert run_wetwell("gateway", "read", file, "--json") == 1
        assert json.loads(capsys.readouterr().out)["s"]["error"] == "cannot connect: connection refused"
    file.write_text("plc = 3\n")
    for arguments, said in (
        (["gateway", "check", file], f"wetwell: {file}: plc: "),
        (["gateway", "--plc", file], f"wetwell: {file}: plc: "),
        (["gateway"], "wetwell: gateway: give --plc FILE, or gateway.plcs in the settings"),
    ):
        assert run_wetwell(*arguments) == 2
        assert capsys.readouterr().err.startswith(said)


def test_an_export_is_drafted_and_converted(
    run_wetwell: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export, mapping, out = (tmp_path / name for name in ("export.csv", "mapping.toml", "north.csv"))
    rows = "2024-11-15T12:00:00Z;120;10;dry\n" * 9
    export.write_text(f"Time;Wet well level [cm];P1 flow [l/s];Weather\n{rows}?;1;2;-\n")
    assert run_wetwell("convert", export, "--draft", mapping) == 0
    assert "level_m: 'Wet well level [cm]' by 'level' in cm: in the header" in capsys.readouterr().out
    assert run_wetwell("convert", export, "--mapping", mapping, "--out", out, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["rows"] == 1
    assert told["unreadable"] == [
        {"rows": 1, "why": "time is not %Y-%m-%d %H:%M:%S", "first": f"{export}, line 11: '?'"},
    ]
    assert told["unmapped"] == [{"tag": "Weather"}]
    assert told["stamps_that_came_again"] == 8
    assert out.read_text().splitlines()[0] == "# wetwell station=export"


EXTERNAL = STATION + 'control = {mode = "external"}\n'
NOBODY_KNOWS = "station 's': control.mode: 'external': nobody knows when pumps start: replay a recording"


@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", "--out", "{tmp}/x.csv"],
        ["up"],
        ["simulator"],
        ["plc"],
        ["dataset", "--count", "1", "--seed", "1", "--out", "{tmp}/set"],
        ["modbus-map"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_nothing_starts_the_pumps_of_a_station_that_others_control(tmp_path, run_wetwell, capsys, arguments) -> None:
    file = tmp_path / "external.toml"
    file.write_text(EXTERNAL)
    given = [argument.format(tmp=tmp_path) for argument in arguments]
    assert run_wetwell(*given, "--station", str(file)) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"wetwell: {NOBODY_KNOWS}")
    assert sorted(tmp_path.iterdir()) == [file]


def test_the_duty_points_tell_pumps_and_mains_by_name(run_wetwell, capsys) -> None:
    assert run_wetwell("station", "show", "twin", "--json") == 0
    table = json.loads(capsys.readouterr().out)
    assert [main["main"] for main in table["mains"]] == ["line 1", "line 2"]
    assert [main["static_head_m"] for main in table["mains"]] == [pytest.approx(14.0 - table["level_m"])] * 2
    assert [row["name"] for row in table["each_pump_alone"]] == ["1.1", "2.1", "1.2", "2.2"]
    alone, together = table["each_pump_alone"], table["all_pumps_together"]
    assert all(one["flow_m3h"] > both["flow_m3h"] for one, both in zip(alone, together, strict=True))


def test_names_for_people_stand_beside_the_keys(
    run_wetwell: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "sued.toml"
    pump = "{curve = [36.0, -0.02, -1.0e-4]}"
    file.write_text(f'name = "sued"\ntitle = "Pumpwerk Süd"\nsump.area_m2 = 8.0\npump = [{pump}, {pump}, {pump}]\n')
    assert run_wetwell("station", "check", file) == 0
    assert capsys.readouterr().out.split() == f"{file}: station 'sued', Pumpwerk Süd, is valid".split()
    assert run_wetwell("station", "show", file, "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    assert (shown["station"], shown["title"]) == ("sued", "Pumpwerk Süd")
    assert [pump["name"] for pump in shown["each_pump_alone"]] == [f"Pumpwerk Süd {number}" for number in (1, 2, 3)]
    recording = tmp_path / "day.csv"
    assert run_wetwell("simulate", file, "--days", 0.02, "--out", recording) == 0
    capsys.readouterr()
    assert run_wetwell("kpi", recording, "--station", file, "--json") == 0
    totals = json.loads(capsys.readouterr().out)["totals"]
    assert [(row["pump"], row["name"]) for row in totals] == [
        (number, f"Pumpwerk Süd {number}") for number in (1, 2, 3)
    ]
