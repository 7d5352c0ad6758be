"""Real routers in a tree, on several loopback addresses: what a branch needs to be let in."""

import asyncio
import contextlib
import subprocess
from pathlib import Path

import pytest
import yaml
from routers import Router

from wetwell.protocols.bus.keys import SITE, history_key, plan_key, sample_key, status_key, verdict_key
from wetwell.protocols.bus.zenoh.access import ZenohAccess
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client

LIMIT_S = 60.0
MANIFESTS = Path(__file__).parents[3] / "docker" / "kubernetes"
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


async def as_on_kubernetes(folder: Path, secrets: dict[str, str]) -> None:
    """What each daemon has to say and to hear, with the users and roles of `docker/kubernetes/`."""
    async with contextlib.AsyncExitStack() as stack:
        root = Router("127.0.0.1", users_file=str(folder / "users"), access_control=str(folder / "access.toml"))
        stack.callback(root.kill)
        branch = Router(
            "127.0.0.2",
            root.address,
            users_file=str(folder / "branch_users"),
            user="branch",
            password=secrets["branch"],
        )
        stack.callback(branch.kill)

        async def client(name: str, router: Router) -> ZenohBus:
            access = ZenohAccess(user=name, password=secrets[name])
            return stack.enter_context(await connect_client(f"tcp/{router.address}", access))

        gateway, historian, dashboard = [await client(name, root) for name in ("gateway", "historian", "dashboard")]
        controller, shard = [await client("fleet", branch) for _ in range(2)]
        questions = historian.answer(history_key("alpha"))
        heard = {
            b"sample": shard.subscribe(sample_key("*"), history=10),
            b"plan": shard.subscribe(plan_key(3), history=1),
            b"verdict": historian.subscribe(verdict_key("*"), history=10),
            b"shard": dashboard.subscribe(status_key(SITE, "shard-3"), history=1),
            b"fleet": dashboard.subscribe(status_key(SITE, "fleet"), history=1),
        }
        for bus, key, payload in (
            (gateway, sample_key("alpha"), b"sample"),
            (gateway, verdict_key("alpha", 1), b"forged"),
            (controller, plan_key(3), b"plan"),
            (shard, verdict_key("alpha", 1), b"verdict"),
            (shard, status_key(SITE, "shard-3"), b"shard"),
            (controller, status_key(SITE, "fleet"), b"fleet"),
        ):
            bus.publisher(key, history=10).put(payload)
        async with asyncio.timeout(LIMIT_S):
            for payload, subscription in heard.items():
                assert await subscription.receive() == [payload]
            asked = asyncio.create_task(shard.ask(history_key("alpha"), b"?"))
            (question,) = await questions.receive()
            question.reply(b"history")
            assert await asked == [b"history"]


def test_users_and_roles_of_the_manifests_let_each_do_its_duty(tmp_path):
    made = subprocess.run(["sh", MANIFESTS / "secrets.sh"], check=True, capture_output=True, text=True).stdout
    secrets = next(yaml.safe_load_all(made))["stringData"]
    for name in ("users", "branch_users"):
        (tmp_path / name).write_text(secrets[name])
    access = yaml.safe_load((MANIFESTS / "access.yaml").read_text())["data"]["access.toml"]
    (tmp_path / "access.toml").write_text(access)
    asyncio.run(as_on_kubernetes(tmp_path, secrets))


@pytest.mark.parametrize("wrong", ["127.0.0.1:1", "udp/127.0.0.1:1"])
def test_a_router_upstream_is_an_endpoint(wrong, run_wetwell, monkeypatch, capsys):
    monkeypatch.setenv("WETWELL_ZENOH__UPSTREAM", f'["{wrong}"]')
    assert run_wetwell("router") == 2
    assert f"zenoh.upstream[1]: got '{wrong}'" in capsys.readouterr().err
