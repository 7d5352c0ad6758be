"""Real routers in a tree, on several loopback addresses: what a branch needs to be let in."""

import asyncio
import contextlib
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from wetwell.protocols.keys import sample_key, verdict_key
from wetwell.protocols.zenoh_access import ZenohAccess
from wetwell.protocols.zenoh_link import connect_client

LIMIT_S = 60.0
ROLES = """
[[role]]
name = "gateway"
publish = ["wetwell/*/sample"]
[[role]]
name = "router"
publish = ["wetwell/**"]
read = ["wetwell/**"]
ask = ["wetwell/**"]
answer = ["wetwell/**"]
"""


def free_address(host: str) -> str:
    with socket.socket() as probe:
        probe.bind((host, 0))
        return f"{host}:{probe.getsockname()[1]}"


class Router:
    """A process `wetwell router`."""

    def __init__(self, host: str, upstream: str | None = None, **settings: str) -> None:
        self.address = free_address(host)
        given = {"endpoint": f"tcp/{self.address}"} | settings
        if upstream is not None:
            given["upstream"] = f'["tcp/{upstream}"]'
        self._environment = os.environ | {f"WETWELL_ZENOH__{name.upper()}": value for name, value in given.items()}
        self.start()

    def start(self) -> None:
        command = [sys.executable, "-m", "wetwell.services", "router"]
        self._process = subprocess.Popen(command, env=self._environment, stderr=subprocess.DEVNULL)

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()


async def with_passwords(folder: Path) -> tuple[list[bytes], list[bytes]]:
    """What comes through a branch that shows a password to a root which asks who comes."""
    (folder / "roles.toml").write_text(ROLES)
    (folder / "users").write_text("router:r\ngateway:g\n")
    (folder / "behind").write_text("detector:d\n")
    async with contextlib.AsyncExitStack() as stack:
        root = Router("127.0.0.1", users_file=str(folder / "users"), access_control=str(folder / "roles.toml"))
        stack.callback(root.kill)
        branch = Router("127.0.0.2", root.address, users_file=str(folder / "behind"), user="router", password="r")
        stack.callback(branch.kill)
        plant = stack.enter_context(
            await connect_client(f"tcp/{root.address}", ZenohAccess(user="gateway", password="g"))
        )
        judge = stack.enter_context(
            await connect_client(f"tcp/{branch.address}", ZenohAccess(user="detector", password="d"))
        )
        samples = judge.subscribe(sample_key("alpha"), history=10)
        plant.publisher(sample_key("alpha"), history=10).put(b"sample")
        judge.publisher(verdict_key("alpha", 1), history=10).put(b"verdict")
        async with asyncio.timeout(LIMIT_S):
            got = await samples.receive()
            answers: list[bytes] = []
            while not answers:  # the gateway may not read verdicts; the router's own role may
                router = stack.enter_context(
                    await connect_client(f"tcp/{root.address}", ZenohAccess(user="router", password="r"))
                )
                answers = await router.ask(verdict_key("alpha", 1), timeout_s=1.0)
    return got, answers


def test_a_branch_shows_a_password_to_the_root(tmp_path):
    got, answers = asyncio.run(with_passwords(tmp_path))
    assert got == [b"sample"]
    assert set(answers) == {b"verdict"}


@pytest.mark.parametrize("wrong", ["127.0.0.1:1", "udp/127.0.0.1:1"])
def test_a_router_upstream_is_an_endpoint(wrong, monkeypatch, capsys):
    from wetwell.services.cli import main  # noqa: PLC0415

    monkeypatch.setenv("WETWELL_ZENOH__UPSTREAM", f'["{wrong}"]')
    monkeypatch.setattr(sys, "argv", ["wetwell", "router"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert f"zenoh.upstream[1]: got '{wrong}'" in capsys.readouterr().err
