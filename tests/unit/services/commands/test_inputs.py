"""Inputs of commands: by an option of their name, and the first also without it; both say the same."""

import json
import os
import re
import runpy
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

from wetwell.services.cli import app
from wetwell.services.commands.inputs import named_words

ROOT = Path(__file__).parents[4]
RECORDING = """time,level_m,pump1_frequency_hz,pump1_flow_m3h,pump1_head_m,pump1_running
2025-01-01T00:00:00Z,1.0,50,100,20,1
2025-01-01T00:00:01Z,1.0,50,100,20,1
"""


def commands(command=None, name="wetwell"):
    """(name, command) of all that can be run, as the command line has them."""
    command = command or typer.main.get_command(app)
    children = getattr(command, "commands", {})
    if not children or command.invoke_without_command:
        yield name, command
    for child, inner in children.items():
        yield from commands(inner, f"{name} {child}")


COMMANDS = dict(commands())

WORDS = st.text(alphabet="abc.=/1", min_size=1, max_size=5)


@given(words=st.lists(st.tuples(st.sampled_from(["bare", "valued", "flag"]), WORDS), max_size=8))
def test_only_words_that_stand_alone_are_named(words):
    given_words, named = [], []
    for kind, word in words:
        line = {"bare": [word], "valued": ["--seed", word], "flag": ["--json"]}[kind]
        given_words += line
        named += ["--recording", *line] if kind == "bare" else line
    assert list(named_words(given_words, "--recording", {"--seed", "--recording"})) == named
    assert list(named_words(named, "--recording", {"--seed", "--recording"})) == named


def test_the_input_may_stand_first_last_or_by_name(run_wetwell, tmp_path: Path, capsys):
    path = tmp_path / "field.csv"
    path.write_text(RECORDING)
    said = []
    for words in (["--recording", path], [path], [f"--recording={path}"]):
        for line in ([*words, "--json"], ["--json", *words]):
            assert run_wetwell("kpi", *line) == 0
            said.append(capsys.readouterr().out)
    assert len(set(said)) == 1
    assert json.loads(said[0])["totals"][0]["pump"] == 1


def test_an_input_that_is_given_twice_is_refused(run_wetwell, capsys):
    assert run_wetwell("station", "check", "alpha", "--station", "twin") == 2
    assert "'--station' is given 2 times" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("export alpha --begin 2024-11-01", "'--begin' is no option of 'export': the nearest is '--from'"),
        ("export alpha --until=2024-11-01", "'--until' is no option of 'export': the nearest is '--to'"),
        ("station check alpha --jsn", "'--jsn' is no option of 'check': the nearest is '--json'"),
        ("up --secnario demo", "'--secnario' is no option of 'up': the nearest is '--scenario'"),
        ("alarms --confg x list", "'--confg' is no option of 'alarms': the nearest is '--config'"),
        ("schema --qqq", "'--qqq' is no option of 'schema': it has "),
    ],
)
def test_an_option_that_a_command_does_not_have_is_told_in_one_line(words, fault, run_wetwell, capsys):
    assert run_wetwell(*words.split()) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"wetwell: {fault}")
    assert said.count("\n") == 1


def test_several_of_an_input_that_may_be_given_again_stand_without_name(run_wetwell, tmp_path, capsys):
    assert run_wetwell("convert", tmp_path / "a.csv", "--draft", tmp_path / "m.toml", tmp_path / "b.csv") == 2
    assert capsys.readouterr().err == f"wetwell: {tmp_path}/a.csv: cannot be read: No such file or directory\n"


def test_a_station_on_the_bus_may_be_named_by_its_file(run_wetwell, tmp_path, capsys):
    file = tmp_path / "x.toml"
    file.write_text('name = "north"\nsump.area_m2 = 8.0\npump = [{curve = [36.0, -0.02, -1.0e-4]}]\n')
    recording = tmp_path / "field.csv"
    recording.write_text(RECORDING)
    data = tmp_path / "history"
    assert run_wetwell("import", recording, "--station", file, "--data", data, "--json") == 0
    assert json.loads(capsys.readouterr().out)["station"] == "north"
    assert run_wetwell("export", file, "--data", data, "--out", tmp_path / "out.csv", "--json") == 0
    assert json.loads(capsys.readouterr().out) == {
        "recording": str(tmp_path / "out.csv"),
        "station": "north",
        "rows": 2,
    }


SILENT = {
    "wetwell simulator", "wetwell plc", "wetwell replay", "wetwell router", "wetwell detector", "wetwell gateway",
    "wetwell alarms", "wetwell historian", "wetwell dashboard", "wetwell fleet",
}  # fmt: skip
"""Daemons, whose logs are on standard error."""


def test_whatever_prints_a_result_prints_it_as_json():
    plain = {
        name for name, command in COMMANDS.items() if not any("--json" in option.opts for option in command.params)
    }
    assert plain == SILENT


def test_an_input_has_one_name_everywhere():
    meanings = {
        "--station",
        "--recording",
        "--scenario",
        "--config",
        "--plc",
        "--alarm",
        "--source",
        "--stations",
        "--name",
        "--trial",
        "--diagnosis",
        "--diagnoses",
    }
    arguments = [(name, p.name) for name, c in COMMANDS.items() for p in c.params if p.param_type_name == "argument"]
    assert arguments == []
    subjects = {command.option for _, command in COMMANDS.items() if hasattr(command, "option")}
    assert subjects <= meanings


def test_help_shows_the_groups_in_order_and_all_that_is_said_of_a_command(run_wetwell, capsys):
    assert run_wetwell("--help") == 0
    said = capsys.readouterr().out
    titles = [line.removesuffix(":") for line in said.splitlines() if line.endswith(":") and line[0] != " "]
    assert titles == ["Options", "Run", "Record", "Judge", "Gap", "Operate", "Administer"]
    assert "..." not in said.partition("\n")[2]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_fits_100_columns_and_says_what_each_value_is(name, run_wetwell, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "250")
    assert run_wetwell(*name.split()[1:], "--help") == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 100
    assert not re.search(r"<\w+( range)?>", said), said
    command = COMMANDS[name]
    silent = [option.opts for option in command.params if not (option.help or option.name == "help")]
    assert silent == []


def test_the_version_is_that_of_the_package(run_wetwell, capsys):
    assert run_wetwell("--version") == 0
    assert capsys.readouterr().out == f"wetwell {version('wetwell')}\n"


def test_the_command_line_loads_nothing_that_help_does_not_need():
    heavy = ("asyncio", "numba", "numpy", "pandas", "pyarrow", "pydantic", "rich", "scipy", "zenoh")
    code = f"import sys, wetwell.services.cli; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("name", ["runtime.settings", "runtime.client", "doctor.leases", "schemas.registry"])
def test_what_a_command_needs_to_ask_and_to_check_its_settings_loads_no_arrays(name):
    heavy = ("numba", "numpy", "pandas", "psycopg", "pyarrow", "scipy")
    code = f"import sys, wetwell.services.{name}; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(
    "environment",
    [
        {"_WETWELL_COMPLETE": "complete_bash", "COMP_WORDS": "wetwell detect --station ", "COMP_CWORD": "3"},
        {"_WETWELL_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": "wetwell detect --station "},
        {
            "_WETWELL_COMPLETE": "complete_fish",
            "_TYPER_COMPLETE_ARGS": "wetwell detect --station ",
            "_TYPER_COMPLETE_FISH_ACTION": "get-args",
        },
    ],
    ids=["bash", "zsh", "fish"],
)
def test_shells_complete_names_of_stations(environment):
    program = Path(sys.executable).with_name("wetwell")
    done = subprocess.run([program], env=os.environ | environment, capture_output=True, text=True, check=False)
    assert "alpha" in done.stdout
    assert "twin" in done.stdout


def test_the_start_of_each_command_is_measured():
    starts = runpy.run_path(str(ROOT / "benchmarks" / "startup.py"))["COMMANDS"]
    names = {name.removeprefix("wetwell ") for name in COMMANDS}
    assert {
        name for name in names if not any(start == name or start.startswith(f"{name} ") for start in starts)
    } == set()
