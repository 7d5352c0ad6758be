"""A real Prometheus over a real `wetwell up` takes every query of the Grafana dashboards, and answers with data."""

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from itertools import product
from pathlib import Path

import httpx
import pytest
import yaml
from browser_site import CLOGGING, Site, until
from ports import free_port

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        shutil.which("prometheus") is None, reason="prometheus is not installed (Debian package of that name)"
    ),
]

ROOT = Path(__file__).parents[2]
BOARDS = [
    json.loads(file.read_text()) for file in sorted((ROOT / "docker" / "grafana" / "dashboards").glob("*.json"))
]
QUERIES = [target["expr"] for board in BOARDS for panel in board["panels"] for target in panel["targets"]]
VARIABLES = [one for board in BOARDS for one in board.get("templating", {}).get("list", [])]
CHOSEN = [{"station": station, "pump": pump} for station, pump in product((".*", "alpha"), (".*", "2", "(1|2|3)"))]
"""What Grafana puts in place of its variables: for all, for one, and for several that are chosen."""
MAX_SPAN_S = 60
SPEED = "1200"
"""Times life: half a minute to the fault, and slow enough that a loaded machine loses no sample."""


def scrape_config(ports):
    """What the page on Grafana tells to give to Prometheus, at the ports of this site."""
    text = (ROOT / "docs" / "grafana.md").read_text(encoding="utf-8")
    told = re.search(r"```yaml\n(.*?)```", text, re.DOTALL)[1]
    here = re.sub(r"(?<=127\.0\.0\.1:)\d+", lambda port: str(ports[int(port[0])]), told)
    return yaml.safe_load(here) | {"global": {"scrape_interval": "1s"}}


@contextlib.contextmanager
def running(command, **environment):
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=os.environ | environment)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(timeout=60)


def pumps_of(site):
    """States of the pumps, as the page has them."""
    stations = httpx.get(f"{site.url}/api/stations", timeout=10).json()["stations"].values()
    return [pump for station in stations for pump in station["pumps"]]


@pytest.fixture(scope="module")
def prometheus(tmp_path_factory):
    """Asks a Prometheus that watches a site whose main clogs, as all pumps tell; gives the answer's data."""
    folder = tmp_path_factory.mktemp("prometheus")
    scenario, config = folder / "quick.toml", folder / "prometheus.yml"
    scenario.write_text(CLOGGING)
    site, health, port = Site(f"tcp/127.0.0.1:{free_port()}", free_port(), folder), free_port(), free_port()
    config.write_text(yaml.safe_dump(scrape_config({9100: health, 8080: site.port})))
    up = [sys.executable, "-m", "wetwell.services", "up", "--scenario", str(scenario), "--speed", SPEED, "--steady"]
    up += ["--zenoh", site.endpoint, "--modbus", f"127.0.0.1:{free_port()}", "--page", f"127.0.0.1:{site.port}"]
    watcher = ["prometheus", f"--config.file={config}", f"--storage.tsdb.path={folder / 'data'}"]
    watcher += [f"--web.listen-address=127.0.0.1:{port}"]
    told = {"WETWELL_HEALTH__HTTP": f"127.0.0.1:{health}", "WETWELL_HEALTH__PERIOD_S": "1"}

    def ask(path, **parameters):
        answer = httpx.get(f"http://127.0.0.1:{port}/api/v1/{path}", params=parameters, timeout=20).json()
        assert answer["status"] == "success", (parameters, answer)
        return answer["data"]

    with running(up, **told) as services, running(watcher) as server:
        until(lambda: pumps_of(site) == ["system_fault"] * 3, services, server)
        told_s = time.time()
        until(lambda: float(ask("query", query="min(timestamp(up))")["result"][0]["value"][1]) > told_s + 2.0, server)
        yield ask


def filled(query, chosen):
    """The query as Grafana sends it."""
    for name, value in chosen.items():
        query = query.replace(f"${name}", value)
    assert "$" not in query
    return query


@pytest.mark.parametrize("query", QUERIES)
def test_each_panel_has_data_whatever_is_chosen(prometheus, query):
    now = time.time()
    for chosen in CHOSEN:
        asked = {"query": filled(query, chosen), "start": now - MAX_SPAN_S, "end": now, "step": 1}
        assert prometheus("query_range", **asked)["result"], asked


@pytest.mark.parametrize("variable", VARIABLES, ids=lambda each: each["name"])
def test_each_variable_has_its_values(prometheus, variable):
    metric, label = re.fullmatch(r"label_values\((.+), (\w+)\)", variable["query"]["query"]).groups()
    found = prometheus(f"label/{label}/values", **{"match[]": filled(metric, CHOSEN[0])})
    assert found == {"station": ["alpha"], "pump": ["1", "2", "3"]}[variable["name"]]


def test_each_fault_is_one_line(prometheus):
    """A main that all pumps feel is told by each of them."""
    queries = [query for query in QUERIES if "wetwell_severity" in query]
    for query in queries:
        found = prometheus("query", query=filled(query, CHOSEN[0]))["result"]
        lines = [tuple(each["metric"].get(name) for name in ("station", "asset", "quantity")) for each in found]
        assert lines
        assert len(lines) == len(set(lines))


def test_all_that_is_scraped_answers(prometheus):
    targets = prometheus("targets")["activeTargets"]
    assert [(each["health"], each["lastError"]) for each in targets] == [("up", "")] * 2
