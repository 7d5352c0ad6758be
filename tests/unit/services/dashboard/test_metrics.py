"""Figures of stations for Prometheus, and the Grafana dashboard that draws them."""

import json
import re
from pathlib import Path

import pytest
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.parser import text_string_to_metric_families

from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.dashboard.view.metrics import StationMetrics
from wetwell.services.dashboard.view.site_view import SiteView

DASHBOARD = Path(__file__).parents[4] / "docker" / "grafana" / "dashboards" / "stations.json"
HOUR = 3600


def sample(second, **fields):
    pump = PumpReading(frequency_hz=50.0, flow_m3h=200.0, head_m=26.0, power_kw=18.0, running=True)
    return Sample(station="alpha", seq=second, time=second * NS_PER_S, level_m=1.5, pumps=(pump,), **fields)


def told():
    severity = {"quantity": "friction_rise_percent", "value": 12.0, "interval": [11.0, 13.0], "limit": 15.0}
    trend = {"per_day": 2.0, "interval": [1.0, 3.0]}
    fault = {"asset": "main", "stage": "plan", "since": 0, "severity": severity, "trend": trend}
    states = {"system_fault": 1.0}
    return Verdict(
        time=0,
        station="alpha",
        pump=1,
        state="system_fault",
        probability=states,
        evidence={},
        window=(0, 0),
        faults=(fault,),
    )


@pytest.fixture
def view():
    site = SiteView(stale_s=10.0)
    site.advance(0.0)
    return site


def figures(view):
    """Value of each figure by name and labels."""
    registry = CollectorRegistry()
    registry.register(StationMetrics(view))
    families = text_string_to_metric_families(generate_latest(registry).decode())
    return {(each.name, *sorted(each.labels.items())): each.value for family in families for each in family.samples}


def test_level_flow_energy_state_and_severity_are_told_by_station_and_pump(view) -> None:
    view.handle_sample(sample(0).encode())
    view.handle_sample(sample(HOUR // 2).encode())
    view.handle_verdict(told().encode())
    view.advance(0.25)
    found = figures(view)
    station, pump = ("station", "alpha"), ("pump", "1")
    assert found["wetwell_station_level_m", station] == 1.5
    assert found["wetwell_station_is_seen", station] == 1.0
    assert found["wetwell_pump_flow_m3h", pump, station] == 200.0
    assert found["wetwell_pump_energy_kwh_total", pump, station] == pytest.approx(9.0)
    assert found["wetwell_pump_state", pump, ("state", "system_fault"), station] == 1.0
    assert found["wetwell_pump_state", pump, ("state", "normal"), station] == 0.0
    labels = (("asset", "main"), pump, ("quantity", "friction_rise_percent"), station)
    names = ("wetwell_severity", "wetwell_severity_limit", "wetwell_severity_trend_per_day")
    assert [found[name, *labels] for name in names] == [12.0, 15.0, 2.0]
    assert found["wetwell_pump_stage", pump, station] == 2.0


@pytest.mark.parametrize("is_bad", [False, True])
def test_a_station_without_good_samples_has_no_measured_values(view, is_bad) -> None:
    view.handle_sample(sample(0).encode())
    if is_bad:
        view.handle_sample(sample(1, quality="bad").encode())
    view.advance(0.25 if is_bad else 60.0)
    found = figures(view)
    assert found["wetwell_station_is_seen", ("station", "alpha")] == 0.0
    assert not [name for name, *_ in found if name.startswith(("wetwell_pump_flow", "wetwell_station_level"))]


def test_a_pause_and_a_step_back_count_no_energy(view) -> None:
    for second in (0, 2 * HOUR, 2 * HOUR - 1):
        view.handle_sample(sample(second).encode())
    assert ("wetwell_pump_energy_kwh_total", ("pump", "1"), ("station", "alpha")) not in figures(view)


def test_the_dashboard_asks_for_what_is_told_and_every_panel_follows_the_variables(view) -> None:
    view.handle_sample(sample(0).encode())
    view.handle_sample(sample(1).encode())
    registry = CollectorRegistry()
    registry.register(StationMetrics(view))
    text = generate_latest(registry).decode()
    known = {each.name for family in text_string_to_metric_families(text) for each in family.samples}
    known |= set(re.findall(r"^# TYPE (\w+) ", text, re.MULTILINE))
    dashboard = json.loads(DASHBOARD.read_text(encoding="utf-8"))
    expressions = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
    queries = [variable["query"]["query"] for variable in dashboard["templating"]["list"]]
    assert {name for each in expressions + queries for name in re.findall(r"wetwell_\w+", each)} <= known
    assert all('station=~"$station"' in each for each in expressions)
    assert [variable["name"] for variable in dashboard["templating"]["list"]] == ["station", "pump"]
    titles = " ".join(panel["title"].lower() for panel in dashboard["panels"])
    assert all(word in titles for word in ("state", "severity", "trend", "flow", "level", "energy"))
