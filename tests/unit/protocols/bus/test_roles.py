"""The table of roles, the secrets in settings, and the router's defaults."""

import json
import logging
import os

import pytest
import zenoh
from typer.testing import CliRunner

from wetwell.protocols.bus.keys import (
    SITE,
    alarm_act_key,
    alarm_key,
    alive_key,
    gap_key,
    history_key,
    model_key,
    order_key,
    sample_block_key,
    sample_key,
    status_key,
    verdict_key,
)
from wetwell.protocols.bus.roles import load_access
from wetwell.protocols.bus.zenoh.access import ZenohAccess
from wetwell.protocols.bus.zenoh.router_log import LogReader
from wetwell.protocols.errors import ConfigError
from wetwell.services.cli import app
from wetwell.services.runtime.connection import access_of, listen
from wetwell.services.runtime.settings import Settings, environment_of, load_settings, secret_of
from wetwell.services.security.exposure import is_loopback

SECRET = "s3cret-of-the-gateway"


def test_the_default_table_lets_only_the_gateway_and_the_simulator_put_samples():
    table = access_of(load_settings(flags={"zenoh": {"access_control": "default"}}).zenoh).table
    assert table is not None
    publishers = {role.name for role in table.role if "wetwell/*/sample" in role.publish}
    assert publishers == {"gateway", "simulator"}
    assert {role.name for role in table.role if "wetwell/*/alarm-act" in role.ask} == {"dashboard", "operator"}
    assert not [key for role in table.role for key in role.read if "**" in key]
    rules = table.zenoh_rules(by_certificate=True)
    assert rules["default_permission"] == "deny"
    names = {rule["id"] for rule in rules["rules"]}
    assert all(set(policy["rules"]) <= names for policy in rules["policies"])
    assert {subject["id"] for subject in rules["subjects"]} == {role.name for role in table.role}


@pytest.mark.parametrize(
    ("role", "act", "key"),
    [
        ("gateway", "publish", sample_key("alpha")),
        ("gateway", "publish", sample_block_key("alpha")),
        ("simulator", "publish", sample_key("alpha")),
        ("detector", "read", sample_key("alpha")),
        ("detector", "read", sample_block_key("alpha")),
        ("detector", "read", order_key("alpha")),
        ("detector", "publish", verdict_key("alpha", 1)),
        ("detector", "publish", model_key("alpha")),
        ("detector", "publish", status_key(SITE, "shard-3")),
        ("detector", "ask", history_key("alpha")),
        ("historian", "read", sample_key("*")),
        ("historian", "read", verdict_key("*")),
        ("historian", "read", alarm_key("*")),
        ("historian", "answer", history_key("*")),
        ("alarms", "read", verdict_key("*")),
        ("alarms", "read", gap_key("*")),
        ("watch", "publish", gap_key("alpha")),
        ("watch", "ask", history_key("alpha")),
        ("dashboard", "read", gap_key("*")),
        ("alarms", "read", status_key("*", "gateway")),
        ("alarms", "read", alive_key("*", "*")),
        ("alarms", "publish", alarm_key("alpha", "a")),
        ("alarms", "answer", alarm_act_key("*")),
        ("dashboard", "read", model_key("*")),
        ("dashboard", "read", status_key("*", "*")),
        ("dashboard", "ask", alarm_act_key("alpha")),
        ("operator", "publish", order_key("alpha")),
        ("operator", "read", verdict_key("alpha", 1)),
    ],
)
def test_the_default_table_lets_each_daemon_do_its_duty(role, act, key):
    table = access_of(load_settings(flags={"zenoh": {"access_control": "default"}}).zenoh).table
    assert table is not None
    (found,) = (each for each in table.role if each.name == role)
    assert any(zenoh.KeyExpr(allowed).includes(zenoh.KeyExpr(key)) for allowed in getattr(found, act))


@pytest.mark.parametrize("role", ["gateway", "detector", "historian", "alarms", "watch", "dashboard", "simulator"])
def test_each_daemon_may_show_that_it_lives(role):
    table = access_of(load_settings(flags={"zenoh": {"access_control": "default"}}).zenoh).table
    assert table is not None
    (found,) = (each for each in table.role if each.name == role)
    assert {status_key("*", role), alive_key("*", role)} <= set(found.publish)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "role: missing"),
        ('[[role]]\nname = "a"\nwrite = ["x"]\n', r"role\[1\]\.write: unknown key"),
        ('[[role]]\nname = "a"\nread = ["wetwell//sample"]\n', r"role\[1\]\.read\[1\]: got 'wetwell//sample'"),
        ('[[role]]\nname = "a"\n[[role]]\nname = "a"\n', "role 'a' is there 2 times"),
    ],
)
def test_a_wrong_table_is_named(tmp_path, text, said):
    file = tmp_path / "access.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=rf"access\.toml: {said}"):
        load_access(file)


def test_a_table_without_names_of_users_is_refused():
    table = access_of(load_settings(flags={"zenoh": {"access_control": "default"}}).zenoh)
    with pytest.raises(ConfigError, match="needs to know who comes"):
        table.settings("router", "tcp/127.0.0.1:1")


def test_a_secret_comes_from_its_file_or_the_environment_and_is_shown_nowhere(tmp_path, monkeypatch):
    file = tmp_path / "password"
    file.write_text(f"{SECRET}\n")
    assert secret_of("zenoh.password", None, file) == SECRET
    monkeypatch.setenv("WETWELL_ZENOH__PASSWORD", SECRET)
    settings = load_settings()
    access = access_of(settings.zenoh.model_copy(update={"user": "gateway"}))
    assert access.password == SECRET
    shown = CliRunner().invoke(app, ["config", "show"]).stdout
    assert json.loads(shown)["zenoh"]["password"] == "**********"
    assert SECRET not in shown + repr(settings) + repr(access) + str(settings.zenoh)
    with pytest.raises(ConfigError, match="are both given") as raised:
        access_of(settings.zenoh.model_copy(update={"password_file": file}))
    assert SECRET not in str(raised.value)
    file.write_text("\n")
    with pytest.raises(ConfigError, match="is empty"):
        secret_of("zenoh.password", None, file)


def test_a_secret_of_the_wrong_form_is_not_repeated(tmp_path):
    file = tmp_path / "wetwell.toml"
    file.write_text("[zenoh]\npassword = 4711\n")
    with pytest.raises(ConfigError) as raised:
        load_settings(file)
    assert str(raised.value) == f"{file}: zenoh.password: input should be a valid string"


def test_children_get_the_secret(monkeypatch):
    monkeypatch.setenv("WETWELL_ZENOH__PASSWORD", SECRET)
    text = environment_of(load_settings())["WETWELL_ZENOH"]
    monkeypatch.delenv("WETWELL_ZENOH__PASSWORD")
    monkeypatch.setenv("WETWELL_ZENOH", text)
    password = load_settings().zenoh.password
    assert password is not None
    assert password.get_secret_value() == SECRET


def test_every_default_listens_on_loopback(monkeypatch):
    for name in [name for name in os.environ if name.startswith("WETWELL_")]:
        monkeypatch.delenv(name)
    found = []

    def visit(path, value):
        if isinstance(value, dict):
            for key, below in value.items():
                visit((*path, key), below)
        elif path[-1] in {"host", "address", "bind"}:
            found.append((path, is_loopback(str(value))))
        elif path[-1] in {"endpoint", "http", "listen"} and value:
            host = str(value).partition("://")[2] or str(value).rpartition("/")[2]
            found.append((path, is_loopback(host.rpartition(":")[0])))

    visit((), Settings().model_dump())
    assert {path for path, _ in found} >= {("zenoh", "endpoint"), ("modbus", "host")}
    assert [path for path, is_safe in found if not is_safe] == []


def test_a_router_for_everybody_is_refused():
    settings = load_settings(flags={"zenoh": {"endpoint": "tcp/0.0.0.0:7447"}})
    with pytest.raises(ConfigError, match=r"the bus: refuses to listen on 0\.0\.0\.0.*zenoh\.users_file"):
        listen(settings)


def test_what_counts_as_asking_who_comes(tmp_path):
    assert ZenohAccess(users_file=tmp_path).asks_who("tcp/0.0.0.0:1")
    assert ZenohAccess(root_ca=tmp_path).asks_who("tls/0.0.0.0:1")
    assert not ZenohAccess(root_ca=tmp_path, is_mutual=False).asks_who("tls/0.0.0.0:1")
    assert not ZenohAccess(user="a", password="b").asks_who("tcp/0.0.0.0:1")


def test_only_messages_that_were_dropped_are_told_and_ever_more_rarely():
    reader = LogReader()
    start = "2026-01-01T00:00:00Z TRACE  rx-1 ThreadId(09) zenoh::net::routing::interceptor"
    denied = f"{start}::access_control: 0a on Username(gw)+Transport(Tcp)+0a is unauthorized to Put (ingress) on w/x"
    dropped = f"{start}: Msg intercepted!"
    other = f"{start}::access_control: 0a on Username(gw)+Transport(Tcp) is authorized to Put (ingress) on w/y"
    assert [reader.told(line) for line in (denied, other, dropped)] == [None, None, None]
    told = [text for _ in range(1000) for text in (reader.told(denied), reader.told(dropped)) if text]
    counts = ("1 time", "10 times", "100 times", "1000 times")
    assert told == [(logging.WARNING, f"'gw' may not put on w/x: dropped ({count})") for count in counts]
    cached = f"{start}::access_control: Using cached result: 0a is unauthorized to Put (ingress) on w/z/@tail"
    assert [reader.told(line) for line in (cached, dropped)][1] == (30, "'gw' may not put on w/z: dropped (1 time)")
    assert reader.told("no line of zenoh's") is None


def test_an_address_in_use_is_told_by_the_error_alone():
    start = "2026-01-01T00:00:00Z  WARN main ThreadId(01) zenoh::net::runtime::orchestrator"
    assert LogReader().told(f"{start}: Unable to open listener tcp/127.0.0.1:7447: in use") is None
    assert LogReader().told(f"{start}: Something else") == (logging.WARNING, "Something else")
