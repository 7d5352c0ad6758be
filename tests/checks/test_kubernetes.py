"""The manifests in `docker/kubernetes/`: the schemas of Kubernetes, and whether all that they name is there."""

import importlib
import math
import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import pytest
import typer
import yaml
from distributed.cli import dask_scheduler, dask_worker

from wetwell.protocols.bus.roles import load_access
from wetwell.services.cli import app
from wetwell.services.runtime.settings import load_settings
from wetwell.services.security.tokens import holder_of
from wetwell.services.stations import find_station

pytestmark = pytest.mark.check

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docker" / "kubernetes"
KUSTOMIZATION = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())
Manifest = dict[str, Any]
MANIFESTS: list[Manifest] = [
    manifest for name in KUSTOMIZATION["resources"] for manifest in yaml.safe_load_all((FOLDER / name).read_text())
]
IDS = [f"{manifest['kind']}-{manifest['metadata']['name']}" for manifest in MANIFESTS]
VERSIONS = ("1.31", "1.34", "1.37")


def of_kind(*kinds: str) -> dict[str, Manifest]:
    return {each["metadata"]["name"]: each for each in MANIFESTS if each["kind"] in kinds}


WORKLOADS = of_kind("Deployment", "StatefulSet")
PODS = {name: each["spec"]["template"] for name, each in WORKLOADS.items()}
SERVICES = of_kind("Service")
POLICIES = of_kind("NetworkPolicy")
CONFIG_MAPS = of_kind("ConfigMap")
OPTIONAL_SECRETS = {("database", "url")}
"""Made by hand where there is a database."""


def container(name: str) -> Manifest:
    (only,) = PODS[name]["spec"]["containers"]
    return dict(only)


def ports(name: str) -> dict[str, int]:
    return {port["name"]: port["containerPort"] for port in container(name)["ports"]}


def environment(name: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for source in container(name).get("envFrom", []):
        found |= CONFIG_MAPS[source["configMapRef"]["name"]]["data"]
    for variable in container(name).get("env", []):
        found[variable["name"]] = variable.get("value", "postgresql://wetwell@db/wetwell")
    return found


def words(name: str) -> list[str]:
    return [*container(name).get("command", ["wetwell"]), *container(name).get("args", [])]


def is_hit(selector: Manifest, labels: dict[str, str]) -> bool:
    """Whether a selector picks what has these labels."""
    assert selector.keys() <= {"matchLabels", "matchExpressions"}
    plain = selector.get("matchLabels", {}).items() <= labels.items()
    for rule in selector.get("matchExpressions", []):
        assert rule["operator"] == "In"
        plain = plain and labels.get(rule["key"]) in rule["values"]
    return plain


def pods_of(selector: Manifest) -> set[str]:
    return {name for name, pod in PODS.items() if is_hit(selector, pod["metadata"]["labels"])}


@pytest.fixture(scope="module")
def schemas() -> ModuleType:
    """Schemas of Kubernetes; not imported at the top, since that takes as long as all tests with them."""
    return importlib.import_module("kubernetes_validate")


@pytest.fixture(scope="module")
def secrets(schemas: ModuleType) -> tuple[dict[str, dict[str, str]], str]:
    """Secrets by name that the script makes, and the token that it shows."""
    made = subprocess.run(["sh", FOLDER / "secrets.sh"], check=True, capture_output=True, text=True)
    found = {}
    for manifest in yaml.safe_load_all(made.stdout):
        schemas.validate(manifest, VERSIONS[-1], strict=True)
        assert manifest["metadata"]["namespace"] == KUSTOMIZATION["namespace"]
        found[manifest["metadata"]["name"]] = manifest["stringData"]
    return found, made.stderr.split()[-1]


def test_all_files_belong_to_it_and_nothing_is_there_twice():
    assert {path.name for path in FOLDER.glob("*.yaml")} == {*KUSTOMIZATION["resources"], "kustomization.yaml"}
    assert len(set(IDS)) == len(IDS)
    assert list(WORKLOADS) == [
        "router",
        "branch",
        "scheduler",
        "worker",
        "fleet",
        "historian",
        "alarms",
        "watch",
        "dashboard",
    ]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("manifest", MANIFESTS, ids=IDS)
def test_the_schemas_of_kubernetes_take_each_manifest(schemas, manifest, version):
    schemas.validate(manifest, version, strict=True)


def test_the_schemas_refuse_what_is_wrong(schemas):
    wrong = {**MANIFESTS[IDS.index("Deployment-worker")], "spec": {"replicas": "two"}}
    with pytest.raises(schemas.ValidationError):
        schemas.validate(wrong, VERSIONS[-1], strict=True)


@pytest.mark.parametrize("name", PODS)
def test_each_pod_is_held_tight(name):
    spec = PODS[name]["spec"]
    only = container(name)
    assert spec["automountServiceAccountToken"] is False
    assert spec["enableServiceLinks"] is False  # Dask reads DASK_...: a Service of that name would set its ports
    assert not {"hostNetwork", "hostPID", "hostIPC"} & set(spec)
    pod_rules = spec["securityContext"]
    assert pod_rules["runAsNonRoot"] is True
    assert min(pod_rules["runAsUser"], pod_rules["runAsGroup"], pod_rules["fsGroup"]) > 0
    assert pod_rules["seccompProfile"] == {"type": "RuntimeDefault"}
    assert only["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert all(set(only["resources"][each]) == {"cpu", "memory"} for each in ("requests", "limits"))
    assert "hostPath" not in chain.from_iterable(spec["volumes"])
    namespace = of_kind("Namespace")[KUSTOMIZATION["namespace"]]
    assert namespace["metadata"]["labels"]["pod-security.kubernetes.io/enforce"] == "restricted"


@pytest.mark.parametrize("name", PODS)
def test_each_pod_is_asked_how_it_is(name):
    only = container(name)
    for kind in ("startupProbe", "readinessProbe", "livenessProbe"):
        asked = only[kind].get("httpGet") or only[kind]["tcpSocket"]
        assert asked["port"] in ports(name)
        if asked["port"] == "health":
            assert asked["path"] in {"/healthz", "/metrics"}
            assert environment(name)["WETWELL_HEALTH__HTTP"] == f"0.0.0.0:{ports(name)['health']}"
    if name not in {"scheduler", "worker", "dashboard"}:
        assert only["readinessProbe"]["httpGet"]["path"] == "/healthz"


@pytest.mark.parametrize("name", PODS)
def test_the_command_line_is_one_that_the_program_takes(name):
    command = words(name)
    programs: dict[str, click.Command] = {"wetwell": typer.main.get_command(app)}
    programs |= {"dask scheduler": dask_scheduler.main, "dask worker": dask_worker.main}
    program = command[0] if command[0] == "wetwell" else " ".join(command[:2])
    parse(programs[program], command[len(program.split()) :])


def parse(command: click.Command, rest: list[str]) -> None:
    """Parse a command line as the program does, and run nothing."""
    context = command.make_context(command.name, list(rest))
    if isinstance(command, click.Group) or hasattr(command, "commands"):
        left = [*context._protected_args, *context.args]
        if left:
            parse(command.commands[left[0]], left[1:])
        return
    left = [*context.args, *context.params.get("preload_argv", ())]  # Dask puts there what it does not know
    if left:
        raise click.UsageError(f"No such option: {left[0]}")


@pytest.mark.parametrize(
    ("program", "rest"),
    [
        (typer.main.get_command(app).commands["fleet"], ["--no-such-flag"]),
        (dask_worker.main, ["tcp://scheduler:8786", "--no-such-flag"]),
        (dask_scheduler.main, ["--port", "8786", "--no-such-flag"]),
    ],
)
def test_a_wrong_command_line_is_refused(program, rest):
    with pytest.raises(Exception, match=r"No such option.*--no-such-flag"):  # typer has a click of its own
        parse(program, rest)


@pytest.mark.parametrize("name", PODS)
def test_settings_are_those_of_the_program(name, monkeypatch):
    for key, value in environment(name).items():
        monkeypatch.setenv(key, value)
        assert key.startswith("WETWELL_") or key == "HOME"
    settings = load_settings()  # refuses what it does not know
    if name in {"router", "branch"}:
        assert settings.zenoh.users_file is not None
    elif name not in {"scheduler", "worker"}:
        assert settings.zenoh.user == name


def test_what_selects_selects_something_and_ports_are_there():
    for name, each in WORKLOADS.items():
        assert pods_of(each["spec"]["selector"]) == {name}
        if each["kind"] == "StatefulSet":
            assert each["spec"]["serviceName"] in SERVICES
    for name, each in SERVICES.items():
        assert pods_of({"matchLabels": each["spec"]["selector"]}) == {name}
        for port in each["spec"]["ports"]:
            assert ports(name)[port["targetPort"]] == port["port"]
    for each in of_kind("PodDisruptionBudget").values():
        (name,) = pods_of(each["spec"]["selector"])
        assert WORKLOADS[name]["spec"]["replicas"] > each["spec"]["maxUnavailable"]  # else no node can be emptied
    for each in POLICIES.values():
        assert pods_of(each["spec"]["podSelector"])


def references(node: Any) -> Iterator[tuple[str, str, list[str]]]:
    """Kind, name and keys of all that a pod takes from elsewhere."""
    if isinstance(node, list):
        for each in node:
            yield from references(each)
    if not isinstance(node, dict):
        return
    for key, value in node.items():
        if key in {"configMapRef", "configMap"}:
            yield "ConfigMap", value["name"], []
        elif key == "secretKeyRef":
            yield "Secret", value["name"], [value["key"]]
        elif key == "secret":
            yield "Secret", value["name"], [item["key"] for item in value["items"]]
        elif key == "persistentVolumeClaim":
            yield "PersistentVolumeClaim", value["claimName"], []
        else:
            yield from references(value)


@pytest.mark.parametrize("name", PODS)
def test_what_a_pod_takes_is_there(name, secrets):
    for kind, other, keys in references(PODS[name]["spec"]):
        if kind == "Secret":
            known = {(secret, key) for secret, data in secrets[0].items() for key in data} | OPTIONAL_SECRETS
            assert {(other, key) for key in keys} <= known
        else:
            assert other in of_kind(kind)
    spec = WORKLOADS[name]["spec"]
    claimed = {claim["metadata"]["name"] for claim in spec.get("volumeClaimTemplates", [])}
    volumes = {volume["name"] for volume in PODS[name]["spec"]["volumes"]} | claimed
    mounts = {mount["mountPath"]: mount["name"] for mount in container(name)["volumeMounts"]}
    assert set(mounts.values()) == volumes
    for place in paths(name):
        if name == "fleet" and place == Path(environment(name)["WETWELL_DETECTOR__STATE_DIR"]):
            continue  # for its shards, in the workers
        assert any(place.is_relative_to(mount) for mount in mounts), place
        if place.is_relative_to("/run/secrets/wetwell"):
            (sources,) = [
                volume["projected"]["sources"] for volume in PODS[name]["spec"]["volumes"] if "projected" in volume
            ]
            given = {item["path"] for source in sources for item in source["secret"]["items"]}
            assert place.name in given


def paths(name: str) -> list[Path]:
    return [Path(text) for text in (*environment(name).values(), *words(name)) if text.startswith("/")]


def test_what_the_controller_names_is_there_in_the_workers():
    mounts = [mount["mountPath"] for mount in container("worker")["volumeMounts"]]
    passed_on = [Path(value) for value in environment("fleet").values() if value.startswith("/")]
    assert passed_on
    assert all(any(place.is_relative_to(mount) for mount in mounts) for place in passed_on)
    (shared,) = [
        claim for claim in of_kind("PersistentVolumeClaim").values() if "detector" in claim["metadata"]["name"]
    ]
    assert shared["spec"]["accessModes"] == ["ReadWriteMany"]


def called(name: str) -> set[tuple[str, int]]:
    """Services, with their ports, whose addresses a pod has."""
    text = " ".join([*environment(name).values(), *words(name)])
    return {(host, int(port)) for host, port in re.findall(r"\btcp:?//?([a-z]+):(\d+)", text)}


def is_open(source: str, target: str, port: int) -> bool:
    """Whether the policies let a pod connect to another one, both ways of looking at it."""

    def lets(pod: str, direction: str, word: str, other: str) -> bool:
        labels = PODS[other]["metadata"]["labels"]
        rules = [
            rule
            for policy in POLICIES.values()
            if pod in pods_of(policy["spec"]["podSelector"])
            for rule in policy["spec"].get(direction, [])
        ]
        return any(
            "podSelector" in peer and is_hit(peer["podSelector"], labels)
            for rule in rules
            if {"port": port} in rule["ports"]
            for peer in rule.get(word, [])
        )

    return lets(source, "egress", "to", target) and lets(target, "ingress", "from", source)


def test_addresses_are_those_of_services_and_the_network_lets_them_through():
    wanted = {(name, *address) for name in PODS for address in called(name)}
    wanted |= {("worker", "branch", 7447)}  # by the settings of the controller
    wanted |= {(source, "worker", port) for source in ("scheduler", "worker", "fleet") for port in (8788, 8789)}
    assert len(wanted) == 5 + 1 + 2 + 1 + 6
    for source, target, port in wanted:
        assert port in ports(target).values()
        assert target == "worker" or port in {each["port"] for each in SERVICES[target]["spec"]["ports"]}
        assert is_open(source, target, port), (source, target)
    bus = {(source, target) for source in PODS for target in ("router", "branch") if is_open(source, target, 7447)}
    assert bus == {(source, target) for source, target, port in wanted if port == 7447}
    dask = {source for source in PODS if is_open(source, "scheduler", 8786) or is_open(source, "worker", 8788)}
    assert dask == {"scheduler", "worker", "fleet"}
    assert POLICIES["nothing"]["spec"] == {"podSelector": {}, "policyTypes": ["Ingress", "Egress"]}


def test_passwords_users_and_roles_fit(secrets, tmp_path):
    data, token = secrets
    bus = data["bus"]
    users = dict(line.split(":") for line in bus["users"].splitlines())
    behind = dict(line.split(":") for line in bus["branch_users"].splitlines())
    assert users | behind == {name: password for name, password in bus.items() if not name.endswith("users")}
    assert len(set((users | behind).values())) == len(users | behind)
    assert set(behind) == {environment("fleet")["WETWELL_ZENOH__USER"]}
    at_root = {
        environment(name).get("WETWELL_ZENOH__USER")
        for name in ("branch", "historian", "alarms", "watch", "dashboard")
    }
    assert set(users) == at_root | {"gateway"}
    (tmp_path / "tokens").write_text(data["tokens"]["tokens"])
    assert holder_of(tmp_path / "tokens", token) is not None

    (tmp_path / "access.toml").write_text(CONFIG_MAPS["access"]["data"]["access.toml"])
    roles = {role.name: role for role in load_access(tmp_path / "access.toml").role}
    assert set(users) <= {who for role in roles.values() for who in role.who}
    assert roles.pop("branch").publish == ("wetwell/_site/status/router", "wetwell/_site/alive/router")
    for role in load_access(ROOT / "services" / "security" / "access.toml").role:
        also = {"users": (role.name, "branch")} if role.name in {"detector", "fleet"} else {}
        assert roles.pop(role.name) == role.model_copy(update=also)
    assert roles == {}


def test_stations_are_right(tmp_path):
    for name, text in CONFIG_MAPS["stations"]["data"].items():
        (tmp_path / name).write_text(text)
        assert f"{find_station(str(tmp_path / name)).name}.toml" == name


def test_the_image_is_of_this_version_and_has_what_the_fleet_needs():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (image,) = KUSTOMIZATION["images"]
    assert image["newTag"] == project["version"]
    assert {container(name)["image"] for name in PODS} == {image["name"]}
    assert "-r requirements/fleet.txt" in (ROOT / "docker" / "Dockerfile").read_text()
    wanted = set((ROOT / "requirements" / "fleet.in").read_text().split()) - {"-c", "-r", "runtime.txt", "runtime.in"}
    assert wanted == set(project["optional-dependencies"]["fleet"])


def test_kustomize_takes_the_folder():
    program = shutil.which("kubectl")
    if program is None:
        pytest.skip("kubectl is not installed")
    built = subprocess.run([program, "kustomize", FOLDER], check=True, capture_output=True, text=True).stdout
    made = list(yaml.safe_load_all(built))
    assert len(made) == len(MANIFESTS)
    assert all(each["metadata"].get("namespace") == "wetwell" for each in made if each["kind"] != "Namespace")
    assert built.count("image: registry.example.com/wetwell:0.1.0") == len(PODS)


def figures(page: str, row: str) -> list[float]:
    """Numbers in the second cell of the row of a page that begins with this."""
    text = (ROOT / page).read_text(encoding="utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith(f"| {row}")]
    return [float(number) for number in re.findall(r"(?<![\d.])\d*\.?\d+", line.split("|")[2])]


def size(cores: float, memory_mb: float | None) -> str:
    memory = "not measured" if memory_mb is None else f"{memory_mb:.0f} MB"
    return f"{math.ceil(100 * cores - 1e-9) / 100:.2f}".removeprefix("0") + f", {memory}"


def test_the_sizes_are_those_of_the_page_on_capacity():
    capacity = "docs/capacity.md"
    router, historian, alarms, detector = figures(capacity, "cores: router, historian, alarms, detector")[:4]
    router_mb, historian_mb, alarms_mb, _ = figures(capacity, "memory: router, historian, alarms, detector")
    per_router_mb, per_alarms_mb = figures(capacity, "memory of router, and of alarms")
    per_station_mb = figures(capacity, "memory of the detector beyond the first 250 MB")[0]
    live_mb, older_mb = figures(capacity, "disk: the live day")
    state_kb = max(figures("benchmarks/README.md", "snapshot after"))
    lines = (ROOT / "docs" / "kubernetes.md").read_text(encoding="utf-8").splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    table = {row[0]: row[1:] for row in rows}
    for column, (stations, workers) in enumerate(((1000, 2), (3000, 3))):
        times, more = stations / 1000, stations - 1000
        each, at_worst = stations / workers, stations / (workers - 1)
        wanted = {
            "": f"{stations:,} stations",
            "`router`, and `branch` likewise: cores, memory": size(router * times, router_mb + per_router_mb * more),
            "`historian`: cores, memory": size(historian * times, None if more else historian_mb),
            "`alarms`: cores, memory": size(alarms * times, alarms_mb + per_alarms_mb * more),
            "workers": str(workers),
            "a worker: cores, memory": size(detector * each / 1000, 250 + per_station_mb * each),
            "a worker when another one is away: cores, memory": size(
                detector * at_worst / 1000, 250 + per_station_mb * at_worst
            ),
            "`detector-states`": f"{state_kb * times:.0f} MB",
            "volume of the historian: first day, a year": f"{live_mb * times:.0f} GB, "
            f"{(live_mb + 365 * older_mb) * times:,.0f} GB",
        }
        assert {name: table[name][column] for name in wanted} == wanted
