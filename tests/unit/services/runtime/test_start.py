"""The start of a daemon is in the audit, with its settings and without its secrets."""

import asyncio
import json

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.options import run
from wetwell.services.runtime.settings import AlarmSettings, SecuritySettings, Settings, load_settings
from wetwell.services.security.audit import Audit


def settings_in(folder, monkeypatch):
    """Settings with secrets in all places that take one."""
    monkeypatch.setattr("sys.argv", ["wetwell", "historian"])
    monkeypatch.setenv("WETWELL_ZENOH__PASSWORD", "hunter2")
    monkeypatch.setenv("WETWELL_LEASE__URL", "postgresql://ann:hunter2@db/name")
    file = folder / "wetwell.toml"
    file.write_text(
        '[historian]\nkeep_days = 9\nurl = "postgresql://ann:hunter2@db/name"\n'
        f'[security]\naudit_dir = "{folder / "audit"}"\n'
    )
    return load_settings(file)


def test_a_start_is_written_down_with_what_is_not_the_default_and_no_secret(tmp_path, monkeypatch):
    run(settings_in(tmp_path, monkeypatch), asyncio.sleep(0))
    text = (tmp_path / "audit" / "historian-audit.jsonl").read_text()
    assert "hunter2" not in text
    entry, stop = map(json.loads, text.splitlines())
    assert (stop["act"], stop["service"]) == ("stop", "historian")
    assert (entry["act"], entry["service"]) == ("start", "historian")
    assert entry["settings"]["historian"] == {"url": "**********", "keep_days": 9}
    assert set(entry["settings"]) == {"zenoh", "lease", "historian", "security"}


def test_a_full_disk_is_told_and_holds_up_no_start(tmp_path, monkeypatch, capsys):
    (tmp_path / "audit" / "historian-audit.jsonl").mkdir(parents=True)
    done = []

    async def daemon():
        done.append(True)

    run(settings_in(tmp_path, monkeypatch), daemon())
    assert done
    assert "historian-audit.jsonl: cannot be written: Is a directory; not in the audit" in capsys.readouterr().err


def test_a_state_that_was_put_back_while_a_daemon_stood_is_told_at_its_start(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["wetwell", "alarms"])
    settings = Settings(
        alarms=AlarmSettings(state_dir=tmp_path), security=SecuritySettings(audit_dir=tmp_path / "audit")
    )
    state = tmp_path / "alarms.json"

    async def daemon(content):
        state.write_text(content)

    run(settings, daemon("old"))
    run(settings, daemon("new"))
    state.write_text("old")
    run(settings, daemon("newest"))
    lines = (tmp_path / "audit" / "alarms-audit.jsonl").read_text().splitlines()
    starts = [entry.get("state") for entry in map(json.loads, lines) if entry["act"] == "start"]
    assert starts == [None, None, "not that of the last stop"]


def test_a_folder_that_cannot_be_made_is_named(tmp_path, monkeypatch):
    settings = settings_in(tmp_path, monkeypatch)
    (tmp_path / "audit").write_text("")
    with pytest.raises(ConfigError, match=r"security\.audit_dir: .*audit: File exists"):
        run(settings, asyncio.sleep(0))
    assert Audit(None).path is None
