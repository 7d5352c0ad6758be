"""Recordings into the history and out of it again, by the command line's functions and by itself."""

import json
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.recordings.recording import Recording, read_recording, write_recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS
from wetwell.services.historian.transfer import export_recording, import_recording

START_NS = 20_000 * DAY_NS


def recording(seconds: int = 3 * 86_400, step_s: int = 600) -> Recording:
    time_s = np.arange(0, seconds, step_s)
    rng = np.random.default_rng(1)
    names = ("level_m", "pump1_frequency_hz", "pump1_flow_m3h", "pump1_head_m", "pump2_flow_m3h")
    columns = {name: rng.normal(size=time_s.size) for name in names}
    columns["level_m"][::7] = np.nan
    return Recording(time_ns=START_NS + time_s * NS_PER_S, columns=columns)


def same(first: Recording, second: Recording) -> bool:
    names = {*first.columns, *second.columns}
    equal = [np.array_equal(first.column(name), second.column(name), equal_nan=True) for name in names]
    return np.array_equal(first.time_ns, second.time_ns) and all(equal)


@pytest.mark.parametrize("suffix", ["csv", "csv.gz", "parquet"])
def test_what_was_imported_is_exported_and_doubles_are_left_out(tmp_path: Path, suffix: str) -> None:
    source, out = Path("a.parquet"), tmp_path / f"b.{suffix}"
    store = FolderStore(tmp_path / "history")
    assert import_recording(store, "alpha", recording(), source) == (432, 432)
    assert import_recording(store, "alpha", recording(), source) == (432, 0)
    while store.maintain(START_NS + 9 * DAY_NS):
        pass
    assert import_recording(store, "alpha", recording(), source) == (432, 0)
    assert export_recording(store, "alpha", START_NS, START_NS + 3 * DAY_NS, out) == 432
    assert same(read_recording(out), recording())
    assert read_recording(out).station == "alpha"
    assert export_recording(store, "alpha", START_NS + DAY_NS, START_NS + 2 * DAY_NS, out) == 144
    with pytest.raises(ConfigError, match="station 'beta': no samples"):
        export_recording(store, "beta", START_NS, START_NS + DAY_NS, out)
    store.close()


def test_a_daily_file_is_a_recording(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "history")
    import_recording(store, "alpha", recording(), tmp_path / "a.parquet")
    assert store.maintain(START_NS + 9 * DAY_NS) is not None
    filed = read_recording(store.archive.path("samples", "alpha", START_NS))
    assert len(filed) == 144
    assert filed.ignored == ("seq", "quality")
    assert filed.station == "alpha"
    store.close()


def test_what_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "history")
    far = Recording(time_ns=np.array([2**63 - 2]), columns={"pump1_flow_m3h": np.zeros(1)})
    with pytest.raises(RecordingError, match="column 'time': lies too far from 1970"):
        import_recording(store, "alpha", far, Path("far.parquet"))
    with pytest.raises(ConfigError, match=r"--station: got '\.\./alpha', must be a name"):
        import_recording(store, "../alpha", far, Path("far.parquet"))
    assert store.stations() == []
    store.close()


def test_the_commands(run_wetwell, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out, data = tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "history"
    write_recording(recording(), source)

    def run(*arguments: object) -> dict[str, object]:
        assert run_wetwell(*arguments, "--data", data, "--json") == 0
        return json.loads(capsys.readouterr().out)

    told = run("import", "--recording", source, "--station", "beta")
    assert told == {"station": "beta", "rows": 432, "new": 432, "doubled": 0}
    entry = json.loads((data / "history-audit.jsonl").read_text())
    assert (entry["act"], entry["station"], entry["recording"]) == ("import", "beta", str(source))
    told = run("export", "--station", "beta", "--out", out)
    assert told == {"recording": str(out), "station": "beta", "rows": 432}
    assert same(read_recording(out), recording())
