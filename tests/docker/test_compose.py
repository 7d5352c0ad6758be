"""The files in `docker/`: what Docker Compose and hadolint say of them, where there are any, and rules of our own."""

import json
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from types import NoneType
from typing import Any, get_args

import pytest
import typer
import yaml
from pydantic import BaseModel

from wetwell.protocols.bus.roles import load_access
from wetwell.services.cli import app
from wetwell.services.runtime.settings import Settings
from wetwell.services.security.tokens import holder_of

pytestmark = pytest.mark.check

ROOT = Path(__file__).parents[2]
DOCKER = ROOT / "docker"
COMPOSE = yaml.safe_load((DOCKER / "compose.yaml").read_text())
OURS = {name: service for name, service in COMPOSE["services"].items() if service["image"].startswith("${WETWELL")}
HAS_ALL_DAEMONS = {"gateway", "historian", "alarms", "watch", "dashboard"} <= set(Settings.model_fields)


def test_a_site_is_complete():
    assert set(OURS) == {"router", "simulator", "gateway", "detector", "historian", "alarms", "watch", "dashboard"}
    profiles = {profile for service in COMPOSE["services"].values() for profile in service.get("profiles", [])}
    assert profiles == {"demo", "plant", "postgres", "monitoring"}


@pytest.mark.parametrize("name", COMPOSE["services"])
def test_each_service_is_held_tight(name):
    service = COMPOSE["services"][name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["restart"] == "unless-stopped"
    assert set(service["deploy"]["resources"]["limits"]) == {"cpus", "memory", "pids"}
    assert service["logging"]["options"]["max-size"]
    assert not service.get("privileged")
    assert all(port.startswith("127.0.0.1:") for port in service.get("ports", []))
    assert re.search(r":(?!latest)[\w.-]+$", service["image"]) or name in OURS
    if name in OURS:
        uid, _, gid = service["user"].partition(":")
        assert int(uid) > 0
        assert int(gid) > 0
    for mount in service.get("volumes", []):
        source = mount.partition(":")[0]
        assert source in COMPOSE["volumes"] or (source.startswith("./") and mount.endswith(":ro"))


def test_no_secret_is_in_the_file():
    for name, service in OURS.items():
        for key, value in service["environment"].items():
            assert not re.search("PASSWORD$|TOKEN$|SECRET$", key), name
            if str(value).startswith("/run/secrets/"):
                assert value.removeprefix("/run/secrets/") in service["secrets"]
    used = {secret for service in COMPOSE["services"].values() for secret in service.get("secrets", [])}
    assert used == set(COMPOSE["secrets"])


def test_each_daemon_is_a_user_that_the_roles_know():
    roles = {role.name for role in load_access(ROOT / "services" / "security" / "access.toml").role}
    for name, service in OURS.items():
        if name != "router":
            assert service["environment"]["WETWELL_ZENOH__USER"] == name
            assert name in roles
            assert f"bus_{name}" in service["secrets"]


def known(path: list[str], model: type[BaseModel]) -> bool:
    """Whether a setting of this path is there."""
    field = model.model_fields.get(path[0])
    if field is None:
        return False
    kinds = [kind for kind in (field.annotation, *get_args(field.annotation)) if isinstance(kind, type)]
    tables = [kind for kind in kinds if kind is not NoneType and issubclass(kind, BaseModel)]
    return len(path) == 1 or any(known(path[1:], table) for table in tables)


@pytest.mark.skipif(not HAS_ALL_DAEMONS, reason="daemons of this file are not built yet")
def test_commands_and_settings_are_those_of_the_program():
    commands: Any = typer.main.get_command(app)
    for service in OURS.values():
        assert service["command"][0] in commands.commands
        for key in service["environment"]:
            assert known(key.removeprefix("WETWELL_").lower().split("__"), Settings), key


def test_secrets_are_made_once_and_fit(tmp_path):
    script = tmp_path / "secrets.sh"
    shutil.copy(DOCKER / "secrets.sh", script)
    first = subprocess.run(["sh", script], check=True, capture_output=True, text=True).stdout
    made = {file.name: file.read_text() for file in (tmp_path / "secrets").iterdir()}
    assert set(made) == set(COMPOSE["secrets"])
    lines = dict(line.split(":") for line in made["bus_users"].splitlines())
    assert lines == {name: made[f"bus_{name}"] for name in OURS if name != "router"}
    (holder,) = tomllib.loads(made["tokens"])["token"]
    assert holder["role"] == "operator"
    assert holder_of(tmp_path / "secrets" / "tokens", first.split()[-1]) is not None
    assert subprocess.run(["sh", script], check=True, capture_output=True, text=True).stdout == ""
    assert made == {file.name: file.read_text() for file in (tmp_path / "secrets").iterdir()}


def test_the_image_runs_as_nobody_and_pins_what_it_takes():
    steps = re.sub(r"\\\n\s*", "", (DOCKER / "Dockerfile").read_text())
    last = steps.rpartition("\nFROM ")[2]
    assert re.search(r"^USER [1-9]\d*:[1-9]\d*$", last, re.MULTILINE)
    assert re.search(r"^HEALTHCHECK .* CMD \[", last, re.MULTILINE)
    assert re.search(r'^ENTRYPOINT \["wetwell"\]$', last, re.MULTILINE)
    assert "--require-hashes" in steps
    assert not re.search(r"^ADD |:latest|apt-get(?!.*--no-install-recommends)|\bsudo\b", steps, re.MULTILINE)
    (installed,) = re.findall(r"pip install --no-cache-dir (\S+)", steps)
    assert "==" in installed
    ignored = (ROOT / ".dockerignore").read_text().split()
    assert {".git", "docker/secrets", "docker/site"} <= set(ignored)


def test_the_page_of_grafana_shows_figures_that_there_are():
    page = json.loads((DOCKER / "grafana" / "dashboards" / "wetwell.json").read_text())
    source = yaml.safe_load((DOCKER / "grafana" / "provisioning" / "datasources" / "prometheus.yaml").read_text())
    assert {panel["datasource"]["uid"] for panel in page["panels"]} == {source["datasources"][0]["uid"]}
    assert len({panel["id"] for panel in page["panels"]}) == len(page["panels"])
    scraped = yaml.safe_load((DOCKER / "prometheus.yaml").read_text())["scrape_configs"][0]["static_configs"][0]
    daemons = {name for name, service in OURS.items() if "WETWELL_HEALTH__HTTP" in service["environment"]}
    assert {target.partition(":")[0] for target in scraped["targets"]} == daemons


@pytest.mark.parametrize("profiles", [["demo"], ["plant", "postgres", "monitoring"]])
def test_docker_takes_the_file(profiles):
    program = shutil.which("docker-compose")
    if program is None:
        pytest.skip("docker-compose is not installed")
    flags = [word for profile in profiles for word in ("--profile", profile)]
    subprocess.run([program, "-f", DOCKER / "compose.yaml", *flags, "config", "--quiet"], check=True)


def test_hadolint_finds_nothing():
    program = shutil.which("hadolint")
    if program is None:
        pytest.skip("hadolint is not installed")
    subprocess.run([program, DOCKER / "Dockerfile"], check=True)
