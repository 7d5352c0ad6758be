"""Tokens: who holds one, what it allows, and that the file never holds the token itself."""

import json
import stat
from datetime import timedelta

import pytest
from typer.testing import CliRunner

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.services.cli import app
from wetwell.services.security.tokens import (
    holder_of,
    new_token,
    read_holders,
    revoke_token,
    standing_of,
    today,
    user,
)


def test_a_token_names_its_holder_until_it_is_revoked(tmp_path):
    file = tmp_path / "tokens.toml"
    room, wall = new_token(file, "control-room", "operator"), new_token(file, "wall-screen", "viewer")
    assert len(room) > 40
    assert room != wall
    found = holder_of(file, room)
    assert found is not None
    assert (found.name, found.may("viewer"), found.may("operator")) == ("control-room", True, True)
    found = holder_of(file, wall)
    assert found is not None
    assert (found.name, found.may("viewer"), found.may("operator")) == ("wall-screen", True, False)
    revoke_token(file, "control-room")
    assert holder_of(file, room) is None
    assert holder_of(file, wall) is not None


def test_a_token_ends_after_its_last_day_and_says_so(tmp_path):
    file = tmp_path / "tokens.toml"
    token = new_token(file, "ada", "operator", days=1)
    last = today() + timedelta(days=1)
    assert f"until = {last}" in file.read_text()
    assert holder_of(file, token) is not None
    file.write_text(file.read_text().replace(str(last), str(today() - timedelta(days=1))))
    assert holder_of(file, token) is None
    result = CliRunner().invoke(app, ["token", "list", "--file", str(file)])
    assert result.stdout == f"ada\toperator\tuntil {today() - timedelta(days=1)}, over\n"
    assert holder_of(file, new_token(file, "eve", "viewer")) is not None
    assert read_holders(file)[1].until is None


def test_each_token_that_is_made_or_revoked_is_in_the_audit_beside_the_file_and_none_of_them_itself(tmp_path):
    file = tmp_path / "tokens.toml"
    made = [new_token(file, "ada", "operator", days=1), new_token(file, "eve", "viewer")]
    revoke_token(file, "ada")
    text = (tmp_path / "tokens-audit.jsonl").read_text()
    lines = [json.loads(line) for line in text.splitlines()]
    assert [(line["act"], line["name"], line["by"]) for line in lines] == [
        ("new token", "ada", user()),
        ("new token", "eve", user()),
        ("revoke token", "ada", user()),
    ]
    assert (lines[0]["role"], lines[0]["until"]) == ("operator", str(today() + timedelta(days=1)))
    assert not any(token.removeprefix("wetwell_") in text for token in made)
    assert not any(holder.sha256 in text for holder in read_holders(file))
    assert standing_of(file, made[0]) == {"token": "revoked", "name": "ada"}


def test_a_token_that_cannot_be_written_down_is_neither_made_nor_revoked(tmp_path):
    file = tmp_path / "tokens.toml"
    token = new_token(file, "ada", "operator")
    (tmp_path / "tokens-audit.jsonl").unlink()
    (tmp_path / "tokens-audit.jsonl").mkdir()
    with pytest.raises(RecordingError, match=r"tokens-audit\.jsonl: cannot be written"):
        new_token(file, "eve", "viewer")
    with pytest.raises(RecordingError, match=r"tokens-audit\.jsonl: cannot be written"):
        revoke_token(file, "ada")
    assert [holder.name for holder in read_holders(file)] == ["ada"]
    assert holder_of(file, token) is not None


@pytest.mark.parametrize("change", [str.upper, str.strip, lambda token: token[:-1], lambda _: "", lambda _: "\udc80"])
def test_anything_but_the_token_is_nobodys(tmp_path, change):
    file = tmp_path / "tokens.toml"
    token = new_token(file, "control-room", "operator")
    assert (holder_of(file, change(token)) is None) == (change(token) != token)


def test_the_file_holds_no_token_and_only_its_owner_may_read_it(tmp_path):
    file = tmp_path / "tokens.toml"
    token = new_token(file, "control-room", "operator")
    assert token.removeprefix("wetwell_") not in file.read_text()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    (holder,) = read_holders(file)
    assert holder_of(file, holder.sha256) is None
    assert holder.sha256 not in repr(holder)


def test_what_is_wrong_is_named(tmp_path):
    file = tmp_path / "tokens.toml"
    with pytest.raises(ConfigError, match=r"tokens\.toml"):
        holder_of(file, "wetwell_x")
    new_token(file, "a", "viewer")
    with pytest.raises(ConfigError, match=r"'a' has a token already"):
        new_token(file, "a", "operator")
    with pytest.raises(ConfigError, match=r"name: got 'two words'"):
        new_token(file, "two words", "viewer")
    with pytest.raises(ConfigError, match=r"nobody is named 'b'"):
        revoke_token(file, "b")
    file.write_text('[[token]]\nname = "a"\nrole = "king"\nsha256 = "00"\n')
    with pytest.raises(ConfigError, match=r"token\[1\]\.role: got 'king'"):
        holder_of(file, "wetwell_x")


def test_the_command_makes_lists_and_revokes(tmp_path, monkeypatch):
    monkeypatch.setenv("WETWELL_SECURITY__TOKENS_FILE", str(tmp_path / "tokens.toml"))

    def run(*arguments):
        result = CliRunner().invoke(app, ["token", *arguments])
        assert result.exit_code == 0, result.output
        return result.stdout

    token = run("new", "--name", "anna", "--role", "operator").strip()
    made = json.loads(run("new", "--name", "wall", "--json"))
    assert (made["name"], made["role"]) == ("wall", "viewer")
    last = today() + timedelta(days=365)
    assert run("list") == f"anna\toperator\tuntil {last}\nwall\tviewer\tuntil {last}\n"
    run("revoke", "--name", "wall")
    assert json.loads(run("list", "--json")) == {
        "holders": [{"name": "anna", "role": "operator", "until": str(last)}]
    }
    found = holder_of(tmp_path / "tokens.toml", token)
    assert found is not None
    assert found.name == "anna"


def test_the_command_needs_a_file():
    result = CliRunner().invoke(app, ["token", "list"])
    assert isinstance(result.exception, ConfigError)
    assert "security.tokens_file" in str(result.exception)
