"""Sets on disk: the same bytes from one process and from two, resumed, interrupted, checked."""

import json
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from wetwell.protocols.errors import ConfigError, RecordingError, WetwellError
from wetwell.protocols.recordings.recording import read_recording
from wetwell.services.batch.dataset import check_dataset, make_dataset, plan_of
from wetwell.services.stations import find_station

pytestmark = pytest.mark.check

COUNT = 6
DAYS = 0.3
OPTIONS = ["--days", str(DAYS), "--seed", "5"]


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def plan():
    return plan_of([find_station("alpha")], 5, COUNT, DAYS, "parquet")


@pytest.fixture(scope="module")
def made(plan, tmp_path_factory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("set")
    make_dataset(plan, folder, workers=1)
    return content(folder)


@pytest.fixture
def folder(made, tmp_path) -> Path:
    for name, data in made.items():
        (tmp_path / name).write_bytes(data)
    return tmp_path


def test_two_workers_give_the_bytes_of_one(plan, made, tmp_path) -> None:
    assert make_dataset(plan, tmp_path, workers=2)["kept"] == 0
    assert content(tmp_path) == made


def test_resume_makes_what_is_missing_cut_or_changed(plan, made, folder) -> None:
    (folder / "000001.parquet").unlink()
    (folder / "000002.parquet").write_bytes(made["000002.parquet"][:1000])
    (folder / "000003.station.toml").write_text("")
    (folder / ".000004.parquet.part").write_bytes(b"half")
    assert make_dataset(plan, folder, workers=1)["kept"] == COUNT - 3
    assert content(folder) == made


def test_a_run_that_died_is_resumed_from_its_journal(plan, made, folder) -> None:
    manifest = json.loads(made["manifest.json"])
    lines = [plan.header, *manifest["items"][:4]]
    (folder / "manifest.json").unlink()
    (folder / "manifest.part.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines) + '{"number": 4, ')
    assert make_dataset(plan, folder, workers=1)["kept"] == 4
    assert content(folder) == made


def test_another_plan_in_the_same_folder_is_refused(folder, made) -> None:
    other = plan_of([find_station("alpha")], 6, COUNT, DAYS, "parquet")
    with pytest.raises(ConfigError, match="holds a dataset with another seed; take another folder"):
        make_dataset(other, folder, workers=1)
    assert {name: data for name, data in content(folder).items() if name != "manifest.part.jsonl"} == made


def test_the_manifest_rebuilds_every_file(run_wetwell, folder, made) -> None:
    manifest = json.loads(made["manifest.json"])
    assert manifest["schema"] == "wetwell.dataset/1"
    assert sum(manifest["classes"].values()) == COUNT == len(manifest["items"])
    assert max(manifest["classes"].values()) - min(manifest["classes"].values()) <= 1
    item = manifest["items"][1]
    again = folder / "again.parquet"
    files = ["--station", folder / item["station_file"], "--scenario", folder / item["scenario_file"]]
    assert run_wetwell("simulate", *files, "--seed", item["seed"], "--out", again) == 0
    assert again.read_bytes() == made[item["file"]]
    for item in manifest["items"]:
        assert find_station(str(folder / item["station_file"])).name == item["station"]["name"]
        recording = read_recording(folder / item["file"])
        assert len(recording) == item["rows"]
        assert set(recording.truth["truth_state"]) - {"normal"} <= {item["class"], "pump_fault", "system_fault"}
        assert (item["class"] == "normal") == (set(recording.truth["truth_state"]) == {"normal"})
        assert item["class"] in recording.truth["truth_state"]


def test_the_example_of_the_docs(monkeypatch, run_wetwell, tmp_path, capsys) -> None:
    text = (Path(__file__).parents[4] / "docs" / "datasets.md").read_text(encoding="utf-8")
    shell, python = (re.findall(rf"```{form}\n(.*?)```", text, flags=re.DOTALL) for form in ("sh", "python"))
    monkeypatch.chdir(tmp_path)
    commands = [line.split() for line in shell[0].splitlines()]
    assert [command[:2] for command in commands] == [["wetwell", "dataset"]] * 2
    for command in commands:
        assert run_wetwell(*command[1:]) == 0
    assert "items: 10" in capsys.readouterr().out
    exec(python[0], {})  # noqa: S102 - the text of our own docs
    manifest = json.loads((tmp_path / "pumps" / "manifest.json").read_text())
    (row,) = [line for line in text.splitlines() if line.startswith("| `manifest.json`")]
    for key in manifest:
        assert key in row or key in {"items", "classes"}
    names = {path.name for path in (tmp_path / "pumps").iterdir()}
    assert {"000001.parquet", "000001.station.toml", "000001.scenario.toml", "manifest.json"} <= names


def test_the_check_finds_a_changed_byte(run_wetwell, folder, capsys) -> None:
    assert run_wetwell("dataset", "--check", folder, "--json") == 0
    assert json.loads(capsys.readouterr().out)["files"] == 3 * COUNT
    changed = bytearray((folder / "000002.parquet").read_bytes())
    changed[500] ^= 1
    (folder / "000002.parquet").write_bytes(changed)
    (folder / "000003.parquet").unlink()
    assert run_wetwell("dataset", "--check", folder) == 2
    said = capsys.readouterr().err.splitlines()
    assert said == [
        f"wetwell: {folder}/000002.parquet: is not what the manifest says, its SHA-256 differs (and 1 more)"
    ]


def test_a_file_outside_of_the_folder_is_not_read(folder) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["items"][0]["file"] = "../secret.parquet"
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(RecordingError, match="is not a file of this folder"):
        check_dataset(folder)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["dataset"], "dataset: give either --out DIR or --check DIR"),
        (["dataset", "--out", "{tmp}/d"], "dataset: give at least one --station FILE"),
        (["dataset", "--check", "{tmp}"], "{tmp}/manifest.json: cannot be read: No such file or directory"),
        (["dataset", "--station", "alpha", "--out", "{tmp}/file"], "{tmp}/file: cannot be written: File exists"),
        (
            ["dataset", "--station", "alpha", "--out", "{tmp}/d", "--days", "0.1"],
            "an item must be at least 0.292 days long, got 0.100",
        ),
        (["dataset", "--out", "{tmp}/d", "--station", "none"], "station 'none' is neither a file nor one of alpha"),
    ],
)
def test_an_error_is_one_line(run_wetwell, tmp_path, capsys, arguments: list[str], said: str) -> None:
    (tmp_path / "file").write_text("")
    assert run_wetwell(*(argument.format(tmp=tmp_path) for argument in arguments)) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("wetwell: " + said.format(tmp=tmp_path))


def test_ctrl_c_ends_with_130_leaves_no_half_file_and_resumes(tmp_path) -> None:
    command = [
        sys.executable,
        "-m",
        "wetwell.services",
        "dataset",
        "--station",
        "alpha",
        "--out",
        str(tmp_path),
        *OPTIONS,
    ]
    journal = tmp_path / "manifest.part.jsonl"
    deadline = time.monotonic() + 300
    with subprocess.Popen(
        [*command, "--count", "5000", "--workers", "2"], stderr=subprocess.PIPE, start_new_session=True
    ) as process:
        try:
            while not journal.exists() or len(journal.read_bytes().splitlines()) < 4:
                assert process.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.05)
            with pytest.raises(ConfigError, match="another run makes this dataset"):
                make_dataset(plan_of([find_station("alpha")], 5, 1, DAYS, "parquet"), tmp_path, workers=1)
        finally:
            process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"Traceback" not in said
    assert not list(tmp_path.glob(".*.part"))
    assert not (tmp_path / "manifest.json").exists()
    summary = make_dataset(plan_of([find_station("alpha")], 5, 3, DAYS, "parquet"), tmp_path, workers=1)
    assert summary["kept"] >= 1
    assert check_dataset(tmp_path)["items"] == 3


def test_a_worker_that_is_killed_is_one_line(plan, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("wetwell.services.batch.dataset._make", _die)
    with pytest.raises(WetwellError, match=r"its process was killed \(out of memory\?\) \(and 1 more\)"):
        make_dataset(replace(plan, count=2), tmp_path, workers=2)


def _die(*_arguments: object) -> None:
    signal.raise_signal(signal.SIGKILL)
