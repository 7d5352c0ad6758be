"""Real routers, started by the command line: who is refused, what nobody may do, and that the log says so."""

import asyncio
import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
import trustme
from ports import free_port

from wetwell.protocols.bus.keys import alarm_act_key, alive_key, sample_key, verdict_key
from wetwell.protocols.bus.zenoh.access import ZenohAccess
from wetwell.protocols.bus.zenoh.link import open_client, open_router
from wetwell.protocols.bus.zenoh.pace import MOST_OPEN, Pace
from wetwell.protocols.bus.zenoh.session import open_client_session
from wetwell.protocols.errors import ConfigError, LinkError

LIMIT_S = 20.0
SECRETS = {"gateway": "gate 1 with:colon", "dashboard": "dash2", "alarms": "alarms3", "detector": "detector4"}


@dataclass
class Router:
    """A process `wetwell router` and what it has said."""

    endpoint: str
    log: Path
    process: subprocess.Popen[bytes]

    def has_said(self, text: str) -> bool:
        return text in self.log.read_text()

    def wait_for(self, text: str) -> None:
        deadline_s = time.monotonic() + LIMIT_S
        while not self.has_said(text):
            assert time.monotonic() < deadline_s, f"{text!r} is not in: {self.log.read_text()}"
            assert self.process.poll() is None, self.log.read_text()
            time.sleep(0.01)


@contextlib.contextmanager
def running_router(folder: Path, scheme: str, **settings: str) -> Iterator[Router]:
    endpoint = f"{scheme}/127.0.0.1:{free_port()}"
    environment = os.environ | {f"WETWELL_ZENOH__{name.upper()}": value for name, value in settings.items()}
    command = [sys.executable, "-m", "wetwell.services", "router", "--zenoh", endpoint]
    log = folder / f"{scheme}.log"
    with log.open("wb") as errors, subprocess.Popen(command, stderr=errors, env=environment) as process:
        router = Router(endpoint, log, process)
        try:
            router.wait_for("router on")
            yield router
            process.terminate()
            assert process.wait(LIMIT_S) == 0
        finally:
            process.kill()


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Certificates of the site's authority and of another one."""
    folder = tmp_path_factory.mktemp("access")
    ours, other = trustme.CA(), trustme.CA()
    for name, authority, owner in (
        ("router", ours, "127.0.0.1"),
        ("gateway", ours, "gateway.site"),
        ("dashboard", ours, "dashboard.site"),
        ("stranger", other, "gateway.site"),
        ("false-router", other, "127.0.0.1"),
    ):
        issued = authority.issue_cert(owner, common_name="gateway" if name == "stranger" else name)
        issued.private_key_pem.write_to_path(str(folder / f"{name}.key"))
        (folder / f"{name}.pem").write_bytes(b"".join(blob.bytes() for blob in issued.cert_chain_pems))
    ours.cert_pem.write_to_path(str(folder / "ca.pem"))
    other.cert_pem.write_to_path(str(folder / "other-ca.pem"))
    (folder / "users").write_text("".join(f"{user}:{secret}\n" for user, secret in SECRETS.items()))
    return folder


@pytest.fixture(scope="module")
def by_password(folder) -> Iterator[Router]:
    users = str(folder / "users")
    with running_router(folder, "tcp", users_file=users, access_control="default") as router:
        yield router


@pytest.fixture(scope="module")
def by_certificate(folder) -> Iterator[Router]:
    paths = {"root_ca": "ca.pem", "certificate": "router.pem", "private_key": "router.key"}
    tls = {f"tls__{name}": str(folder / file) for name, file in paths.items()}
    with running_router(folder, "tls", access_control="default", **tls) as router:
        yield router


def user(name: str) -> ZenohAccess:
    return ZenohAccess(user=name, password=SECRETS[name])


def holder(folder: Path, name: str | None, authority: str = "ca.pem") -> ZenohAccess:
    files = {} if name is None else {"certificate": folder / f"{name}.pem", "private_key": folder / f"{name}.key"}
    return ZenohAccess(root_ca=folder / authority, **files)


@pytest.mark.parametrize(
    ("access", "told"),
    [
        (ZenohAccess(user="gateway", password="wrong"), "wrong password"),
        (ZenohAccess(user="nobody", password="dash2"), "no such user"),
        (ZenohAccess(), "no user and password"),
    ],
)
def test_wrong_or_no_password_is_refused_and_logged(by_password, access, told):
    with pytest.raises(LinkError) as raised:
        open_client(by_password.endpoint, access, timeout_s=0.3)
    expected = f"refuses user '{access.user}' or the password" if access.user else "wrong credentials look the same"
    assert expected in str(raised.value)
    assert "wrong)" not in str(raised.value)
    by_password.wait_for(f"a client is refused: {told}")
    by_password.wait_for("connection from 127.0.0.1:")


@pytest.mark.parametrize(
    ("name", "authority", "told"),
    [
        ("stranger", "ca.pem", "a certificate that is not of zenoh.tls.root_ca"),
        (None, "ca.pem", "no certificate"),
        ("gateway", "other-ca.pem", "it does not trust this router's certificate"),
    ],
)
def test_wrong_certificate_is_refused_and_logged(by_certificate, folder, name, authority, told):
    with pytest.raises(LinkError, match="refuses one of the certificates"):
        open_client(by_certificate.endpoint, holder(folder, name, authority), timeout_s=0.3)
    by_certificate.wait_for(f"a client is refused: {told}")


def test_a_router_of_another_authority_is_not_trusted(folder):
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with (
        open_router(endpoint, holder(folder, "false-router", "other-ca.pem")),
        pytest.raises(LinkError, match="one of the certificates"),
    ):
        open_client(endpoint, holder(folder, "gateway"), timeout_s=0.3)


async def check_roles(router: Router, gateway: ZenohAccess, dashboard: ZenohAccess) -> None:
    """The gateway's samples arrive; what it or the dashboard may not put is dropped and logged."""
    with (
        open_client(router.endpoint, gateway) as plant,
        open_client(router.endpoint, dashboard) as screen,
        open_client(router.endpoint, dashboard) as watcher,
        open_client(router.endpoint, gateway) as spy,
    ):
        samples, spied = watcher.subscribe(sample_key("*"), history=10), spy.subscribe(sample_key("*"))
        verdicts, presences = watcher.subscribe(verdict_key("*")), watcher.watch(alive_key("*", "*"))
        plant.announce(alive_key("alpha", "gateway"))
        true, forged_sample = plant.publisher(sample_key("alpha"), history=10), screen.publisher(sample_key("alpha"))
        forged_verdict = plant.publisher(verdict_key("alpha", 1))
        async with asyncio.timeout(LIMIT_S):
            true.put(b"1")
            got = await samples.receive()
            seen: set[str] = set()
            while alive_key("alpha", "gateway") not in seen:  # the router shows itself too
                seen |= {presence.key for presence in await presences.receive()}
            while not (
                router.has_said("'gateway' may not put on wetwell/alpha/verdict/1: dropped")
                and router.has_said("'dashboard' may not put on wetwell/alpha/sample: dropped")
            ):
                forged_verdict.put(b"forged")
                forged_sample.put(b"made up")
                await asyncio.sleep(0.01)
            true.put(b"2")
            while b"2" not in got:
                got += await samples.receive()
        assert list(dict.fromkeys(got)) == [b"1", b"2"]
        late = watcher.subscribe(sample_key("alpha"), history=10)
        async with asyncio.timeout(LIMIT_S):
            kept: list[bytes] = []
            while b"2" not in kept:
                kept += await late.receive()
            assert kept[0] == b"1"
        assert b"2" in await watcher.ask(sample_key("alpha"), timeout_s=1.0)
        for silent in (verdicts, spied):  # a gateway may not read
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(silent.receive(), 0.05)
    router.wait_for("'gateway' may not declare subscriber on wetwell/*/sample: dropped")


def test_roles_of_users(by_password):
    asyncio.run(check_roles(by_password, user("gateway"), user("dashboard")))


def test_roles_of_certificates(by_certificate, folder):
    asyncio.run(check_roles(by_certificate, holder(folder, "gateway"), holder(folder, "dashboard")))


@pytest.mark.parametrize("name", sorted(SECRETS))
def test_everybody_may_ask_whether_the_router_has_taken_what_was_declared(by_password, name, monkeypatch):
    monkeypatch.setattr("wetwell.protocols.bus.zenoh.pace.PATIENCE_S", 10.0 * LIMIT_S)
    pace, deadline_s = Pace(), time.monotonic() + LIMIT_S
    with open_client_session(by_password.endpoint, user(name), LIMIT_S) as session:
        pace.count(session, MOST_OPEN)
        while pace.is_behind:
            assert time.monotonic() < deadline_s
            time.sleep(0.01)
    assert not by_password.has_said(f"'{name}' may not liveliness")


def test_only_who_may_ask_reaches_who_may_answer(by_password):
    async def act() -> tuple[list[bytes], list[bytes]]:
        with (
            open_client(by_password.endpoint, user("alarms")) as alarms,
            open_client(by_password.endpoint, user("detector")) as detector,
            open_client(by_password.endpoint, user("dashboard")) as dashboard,
        ):
            questions, false = alarms.answer(alarm_act_key("*")), detector.answer(alarm_act_key("*"))

            async def answer() -> None:
                while True:
                    for request in await questions.receive():
                        request.reply(b"done")

            async def answer_falsely() -> None:
                while True:
                    for request in await false.receive():
                        request.reply(b"forged")

            answering = [asyncio.create_task(answer()), asyncio.create_task(answer_falsely())]
            async with asyncio.timeout(LIMIT_S):
                while not (allowed := await dashboard.ask(alarm_act_key("alpha"), timeout_s=1.0)):
                    pass
            with open_client(by_password.endpoint, user("gateway")) as gateway:
                denied = await gateway.ask(alarm_act_key("alpha"), timeout_s=0.5)
            for task in answering:
                task.cancel()
            return allowed, denied

    assert asyncio.run(act()) == ([b"done"], [])
    by_password.wait_for("'gateway' may not query on wetwell/alpha/alarm-act: dropped")


def test_no_secret_is_in_a_log(by_password, by_certificate, folder):
    wrong = ZenohAccess(user="gateway", password=SECRETS["dashboard"])
    for router, access in ((by_password, wrong), (by_certificate, holder(folder, None))):
        with pytest.raises(LinkError):
            open_client(router.endpoint, access, timeout_s=0.3)
        router.wait_for("a client is refused")
    said = by_password.log.read_text() + by_certificate.log.read_text()
    assert not [secret for secret in SECRETS.values() if secret in said]


def test_what_is_missing_is_told_before_anybody_connects(folder):
    gateway = holder(folder, "gateway")
    for endpoint, access, said in (
        ("tcp/127.0.0.1:1", ZenohAccess(user="gateway"), "zenoh.password"),
        ("tls/127.0.0.1:1", replace(gateway, private_key=None), "zenoh.tls.private_key"),
        ("tls/127.0.0.1:1", ZenohAccess(), "zenoh.tls.root_ca is missing"),
        ("tls/127.0.0.1:1", replace(gateway, root_ca=folder / "none.pem"), "none.pem: cannot be read: No such file"),
    ):
        with pytest.raises(ConfigError) as raised:
            open_client(endpoint, access, timeout_s=0.1)
        assert said in str(raised.value)
    with pytest.raises(ConfigError, match=r"a router needs zenoh\.tls\.certificate"):
        open_router("tls/127.0.0.1:1", ZenohAccess(root_ca=folder / "ca.pem"))
