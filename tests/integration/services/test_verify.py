"""`wetwell doctor --verify`: a single bit that flips in anything that is kept shows, and nothing else does."""

import contextlib
import json
import shutil
import sqlite3

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.messages.alarm import AlarmAct
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.detector.checkpoint import checkpoint_in
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.doctor.finding import Finding
from wetwell.services.doctor.verify import verify_kept
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Batch, StoreError
from wetwell.services.historian.store.live.salvage import damage_of
from wetwell.services.runtime.settings import (
    AlarmSettings,
    DetectorSettings,
    HistorianSettings,
    SecuritySettings,
    Settings,
)
from wetwell.services.security.audit import audit_in
from wetwell.services.security.audit_chain import broken_lines, end_of, is_cut_off
from wetwell.services.security.tokens import new_token
from wetwell.services.stations import find_scenario
from wetwell.simulator.simulation import Simulation

NOW_NS = 1_800_000_000_000_000_000


@pytest.fixture(scope="module")
def kept(alpha, tmp_path_factory):
    """History with a complete day, checkpoint, alarms and audit of a station."""
    folder = tmp_path_factory.mktemp("kept")
    recording = Simulation(alpha, find_scenario("nominal"), 1).advance(3 * 86_400, truth=False)
    every = Samples.of_recording(recording).select(slice(0, None, 60))
    store = FolderStore(folder / "history")
    store.write(Batch(samples=every.rows("alpha")))
    historian = Historian(store)
    verdict = Verdict(
        time=NOW_NS, station="alpha", pump=2, state="pump_fault", probability={}, evidence={}, onset=0, window=(0, 0)
    )
    historian.handle("verdicts", verdict.encode())
    historian.commit(NOW_NS)
    while historian.maintain(NOW_NS + DAY_NS):
        pass
    store.close()
    with MemoryBus() as bus:
        StationDetector(bus, alpha, checkpoint=checkpoint_in(folder / "detector", "alpha")).keep()
        settings = AlarmSettings(state_dir=folder / "alarms")
        service = AlarmService(bus, settings, [alpha], lambda: Now(NOW_NS, 0.0))
        service.handle_verdict(verdict.encode())
        service.look()
        for number in range(3):
            act = {"station": "alpha", "alarm": "pump2.pump_fault", "act": "acknowledge", "by": "Ann"}
            service.carry_out(AlarmAct.model_validate(act | {"id": f"act-{number}"}))
        service.save()
    return folder


def verified(folder) -> dict[str, list[Finding]]:
    settings = Settings(
        historian=HistorianSettings(folder=folder / "history"),
        detector=DetectorSettings(state_dir=folder / "detector"),
        alarms=AlarmSettings(state_dir=folder / "alarms"),
    )
    found: dict[str, list[Finding]] = {}
    for finding in verify_kept(settings):
        found.setdefault(finding.level, []).append(finding)
    return found


def test_what_was_written_is_well(kept):
    found = verified(kept)
    assert [finding.check for finding in found["ok"]] == ["history", "history", "detector", "alarms", "audit"]
    assert set(found) == {"ok"}


@pytest.mark.parametrize(
    ("pattern", "check"),
    [
        ("history/samples/*/*.parquet", "history"),
        ("detector/*.detector.json", "detector"),
        ("alarms/alarms.json", "alarms"),
        ("alarms/alarm-audit.jsonl", "audit"),
    ],
)
@pytest.mark.parametrize("place", [0.3, 0.5, 0.7])
def test_a_bit_that_flips_is_found_and_no_file_is_changed_by_looking(kept, tmp_path, pattern, check, place):
    folder = tmp_path / "copy"
    shutil.copytree(kept, folder)
    file = min(folder.glob(pattern))
    content = bytearray(file.read_bytes())
    content[int(place * len(content))] ^= 0x04
    file.write_bytes(content)
    found = verified(folder)
    assert [finding.check for finding in found["error"]] == [check]
    assert file.read_bytes() == content


def test_a_message_that_was_changed_in_the_database_is_found(kept, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(kept, folder)
    file = folder / "history" / "live.sqlite"
    file.write_bytes(file.read_bytes().replace(b'"pump_fault"', b'"pump_fqult"'))
    (finding,) = verified(folder)["error"]
    assert "messages are not what was written" in finding.text


@pytest.mark.parametrize("damage", ["change", "remove", "insert", "swap"])
def test_a_line_of_the_audit_that_is_not_as_it_was_shows(kept, tmp_path, damage):
    lines = (kept / "alarms" / "alarm-audit.jsonl").read_text().splitlines()
    assert len(lines) == 3
    first, second, third = lines
    changed = {
        "change": [first, second.replace("Ann", "Bob"), third],
        "remove": [first, third],
        "insert": [first, json.dumps({"act": "shelve"}), second, third],
        "swap": [second, first, third],
    }[damage]
    path = tmp_path / "audit.jsonl"
    path.write_text("\n".join(changed) + "\n")
    assert broken_lines(path)
    path.write_text("\n".join(lines) + "\n")
    assert broken_lines(path) == []


@pytest.mark.parametrize("left", [b"", b"line", None])
def test_lines_that_are_cut_off_at_the_end_of_the_audit_show_and_stay_told(tmp_path, left):
    audit = audit_in(tmp_path, "alarm")
    for number in range(4):
        audit.write(NOW_NS, act="shelve", number=number)
    assert not is_cut_off(audit.path)
    lines = audit.path.read_bytes().splitlines(keepends=True)
    if left is None:
        audit.path.unlink()
    else:
        audit.path.write_bytes(b"".join(lines[:2]) + left)
    settings = Settings(
        alarms=AlarmSettings(state_dir=tmp_path), historian=HistorianSettings(folder=tmp_path / "none")
    )
    (finding,) = verify_kept(settings)
    assert (finding.check, finding.level) == ("audit", "error")
    assert "lines at its end are lost" in finding.text
    audit_in(tmp_path, "alarm").write(NOW_NS, act="shelve", number=4)
    told = [json.loads(line).get("act") for line in audit.path.read_text().splitlines() if line.startswith("{")]
    assert told[-2:] == ["found that lines before this one are lost", "shelve"]
    assert not is_cut_off(audit.path)


def test_each_audit_of_a_site_is_checked(tmp_path):
    tokens_file = tmp_path / "etc" / "tokens.toml"
    tokens_file.parent.mkdir()
    new_token(tokens_file, "ada", "operator")
    new_token(tokens_file, "eve", "viewer")
    for folder, names in (("alarms", ["alarm"]), ("audit", ["dashboard", "simulator"]), ("history", ["history"])):
        (tmp_path / folder).mkdir()
        for name in names:
            audit = audit_in(tmp_path / folder, name)
            audit.write(NOW_NS, act="one")
            audit.write(NOW_NS, act="two")
    settings = Settings(
        alarms=AlarmSettings(state_dir=tmp_path / "alarms"),
        historian=HistorianSettings(folder=tmp_path / "history"),
        security=SecuritySettings(audit_dir=tmp_path / "audit", tokens_file=tokens_file),
    )
    audits = sorted(tmp_path.rglob("*-audit.jsonl"))
    assert [(finding.level, finding.check) for finding in verify_kept(settings)] == [("ok", "audit")] * 5
    assert len(audits) == 5
    for audit in audits:
        audit.write_text(audit.read_text().split("\n", 1)[1])
        (finding,) = [finding for finding in verify_kept(settings) if str(audit) in finding.text]
        assert (finding.level, finding.text) == ("error", f"{audit}: damaged: line 1 is not what was written")


def test_an_audit_that_was_killed_before_its_end_was_written_down_is_whole(tmp_path):
    audit = audit_in(tmp_path, "alarm")
    audit.write(NOW_NS, act="shelve", number=1)
    end = end_of(audit.path).read_bytes()
    audit.write(NOW_NS, act="shelve", number=2)
    end_of(audit.path).write_bytes(end)
    assert not is_cut_off(audit.path)
    audit_in(tmp_path, "alarm").write(NOW_NS, act="shelve", number=3)
    assert broken_lines(audit.path) == []
    assert len(audit.path.read_text().splitlines()) == 3


def test_the_chain_goes_on_after_a_restart_and_behind_lines_of_an_earlier_version(tmp_path):
    path = tmp_path / "alarm-audit.jsonl"
    path.write_text('{"time": "2026-01-01T00:00:00Z", "act": "acknowledge"}\n')
    for number in range(4):
        audit_in(tmp_path, "alarm").write(NOW_NS, act="shelve", number=number)
    assert broken_lines(path) == []
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], *lines[2:]]) + "\n")
    assert broken_lines(path) == [2]


def test_a_daily_file_of_another_form_is_put_aside(kept, tmp_path):
    folder = tmp_path / "history"
    shutil.copytree(kept / "history", folder)
    (file,) = (folder / "samples" / "station=alpha").glob("*.parquet")
    wrong = folder / "minutes" / "station=beta" / file.name
    wrong.parent.mkdir(parents=True)
    shutil.copyfile(file, wrong)
    (tens,) = (folder / "tens" / "station=alpha").glob("*.parquet")
    shutil.copyfile(tens, file)
    text = verified(tmp_path)["error"][0].text
    assert f"{wrong}: holds no minutes" in text
    assert f"{file}: holds no samples" in text
    with contextlib.closing(FolderStore(folder)) as store:
        with pytest.raises(StoreError, match="holds no samples"):
            store.samples("alpha", 0, 2**62)
        for _ in store.scrub():
            pass
        store.samples("alpha", 0, 2**62)
    assert {path.parent.name for path in folder.rglob("*.refused")} == {"station=alpha", "station=beta"}


def test_a_daily_file_of_another_station_or_day_is_put_aside_by_a_look_through(kept, tmp_path):
    folder = tmp_path / "history"
    shutil.copytree(kept / "history", folder)
    (file,) = (folder / "samples" / "station=alpha").glob("*.parquet")
    for station, day in (("beta", file.name), ("alpha", "2031-01-01.parquet")):
        path = folder / "samples" / f"station={station}" / day
        path.parent.mkdir(exist_ok=True)
        shutil.copyfile(file, path)
    found = verified(tmp_path)["error"]
    assert [finding.check for finding in found] == ["history"]
    assert found[0].text.count("or of another day") == 2
    with contextlib.closing(FolderStore(folder)) as store:
        for _ in store.scrub():
            pass
        assert store.damages == 2
        assert len(store.samples("alpha", 0, 2**62)) > 0
    assert {path.name for path in folder.rglob("*.refused")} == {f"{file.name}.refused", "2031-01-01.parquet.refused"}
    assert file.exists()


def test_a_look_through_reads_messages_and_hours_of_a_day_whose_samples_are_in_a_file(kept, tmp_path):
    folder = tmp_path / "history"
    shutil.copytree(kept / "history", folder)
    with contextlib.closing(sqlite3.connect(folder / "live.sqlite", isolation_level=None)) as database:
        hours = database.execute("SELECT hour_ns FROM hour ORDER BY hour_ns").fetchall()
        samples = database.execute("SELECT count(*) FROM sample WHERE time_ns < ?", hours[1]).fetchone()
        assert samples == (0,)
        database.execute("UPDATE hour SET data = zeroblob(length(data)) WHERE hour_ns = ?", hours[0])
        (first_ns,) = database.execute("SELECT min(time_ns) FROM event").fetchone()
        database.execute("UPDATE event SET payload = payload || ' ' WHERE time_ns = ?", (first_ns,))
        changed = database.execute("SELECT changes()").fetchone()[0]
    with contextlib.closing(FolderStore(folder)) as store:
        for _ in store.scrub():
            pass
        assert store.damages == 1 + changed
    assert damage_of(folder / "live.sqlite") == []
