"""The wheel, built from the source distribution, works in an environment with nothing else of this repository."""

import json
import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

pytestmark = [pytest.mark.check, pytest.mark.timeout(1800)]

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
VERSIONS = ("3.11", "3.12", "3.13", "3.14")
IMPORT_ALL = """
import importlib, json, pkgutil, wetwell
names = [found.name for found in pkgutil.walk_packages(wetwell.__path__, "wetwell.") if "__main__" not in found.name]
missing = {}
for name in names:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        missing[name] = error.name
print(json.dumps({"modules": len(names), "missing": missing}))
"""
EXTRAS = {"distributed", "pyswmm", "river", "statsmodels"}
"""What only extras bring."""
USE = """
import wetwell
hour = wetwell.simulate("alpha", days=1 / 24, seed=7)
assert len(hour) == 3600
hour.write("hour.parquet")
assert len(wetwell.detect("hour.parquet", "alpha").verdicts) > 0
print(wetwell.__version__)
"""


def run(*command: object, cwd: Path, **more: Path) -> str:
    """What a command prints, with some more variables in its environment."""
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))
    } | {name: str(path) for name, path in more.items()}
    environment["NUMBA_OPT"] = "0"  # a new place has no machine code yet, and this compiles it in half of the time
    done = subprocess.run(
        list(map(str, command)), cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built from the source distribution, unpacked elsewhere, as an installer does it."""
    folder = tmp_path_factory.mktemp("dist")
    run(BIN / "hatchling", "build", "-t", "sdist", "-d", folder, cwd=ROOT)
    (packed,) = folder.glob("*.tar.gz")
    with tarfile.open(packed) as archive:
        archive.extractall(folder, filter="data")
    run(BIN / "hatchling", "build", "-t", "wheel", "-d", folder, cwd=folder / packed.name.removesuffix(".tar.gz"))
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_all_that_the_packages_hold_and_nothing_else(wheel):
    packages = ("protocols", "simulator", "detector", "sim2real", "services")
    tracked = run("git", "ls-files", *packages, cwd=ROOT).splitlines()
    wanted = {f"wetwell/{name}" for name in tracked} | {"wetwell/__init__.py", "wetwell/py.typed"}
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert held == wanted


def test_the_metadata_are_those_of_the_project(wheel):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    archive = zipfile.ZipFile(wheel)
    (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
    lines = archive.read(name).decode().splitlines()
    assert f"Version: {project['version']}" in lines
    assert {line.removeprefix("Provides-Extra: ") for line in lines if line.startswith("Provides-Extra")} == set(
        project["optional-dependencies"]
    )


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
def test_it_installs_and_runs_in_an_empty_environment(version, wheel, tmp_path):
    uv = BIN / "uv"
    others = [str(folder) for folder in sorted(Path.home().glob(".pyenv/versions/*/bin"))]
    path = {"PATH": os.pathsep.join([*others, os.environ["PATH"]])}
    find = [uv, "python", "find", "--no-project", "--no-python-downloads", version]
    found = subprocess.run(find, env=os.environ | path, capture_output=True, check=False)
    if found.returncode != 0:
        pytest.skip(f"no Python {version} on this machine")
    environment = tmp_path / "environment"
    run(uv, "venv", "--no-project", "--python", found.stdout.decode().strip(), environment, cwd=tmp_path)
    pins = ROOT / "requirements" / "runtime.txt"
    python = environment / "bin" / "python"
    run(uv, "pip", "install", "--python", python, "--require-hashes", "-r", pins, cwd=tmp_path)
    run(uv, "pip", "install", "--python", python, "--no-deps", wheel, cwd=tmp_path)
    run(uv, "pip", "check", "--python", python, cwd=tmp_path)
    told = json.loads(run(python, "-W", "ignore", "-c", IMPORT_ALL, cwd=tmp_path))
    assert set(told["missing"].values()) <= EXTRAS, told
    assert told["modules"] > 400
    wetwell = environment / "bin" / "wetwell"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert run(wetwell, "--version", cwd=tmp_path) == f"wetwell {project['version']}\n"
    assert json.loads(run(wetwell, "schema", "station", cwd=tmp_path))["title"] == "Station"
    assert run(python, "-c", USE, cwd=tmp_path) == f"{project['version']}\n"


@pytest.mark.parametrize(
    ("words", "home", "commands"),
    [
        (("uv", "tool", "install", "--python", sys.executable), "UV_TOOL_DIR", "UV_TOOL_BIN_DIR"),
        (("pipx", "install", "--python", sys.executable), "PIPX_HOME", "PIPX_BIN_DIR"),
    ],
    ids=["uv tool", "pipx"],
)
def test_it_installs_as_a_command_of_its_own(words, home, commands, wheel, tmp_path):
    name, *rest = words
    places = {home: tmp_path / "home", commands: tmp_path / "commands"}
    run(BIN / name, *rest, wheel, cwd=tmp_path, **places)
    wetwell = tmp_path / "commands" / "wetwell"
    assert run(wetwell, "--version", cwd=tmp_path).startswith("wetwell ")
    assert json.loads(run(wetwell, "station", "check", "alpha", "--json", cwd=tmp_path))["is_valid"]
