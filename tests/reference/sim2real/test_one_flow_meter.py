"""One flow meter in the main of two pumps: from the export to the flows of each, to verdicts and diagnosis."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.importers.conversion import convert
from wetwell.protocols.recordings.importers.mapping import load_mapping
from wetwell.protocols.recordings.recording import read_recording
from wetwell.protocols.station.station_file import load_station
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

pytestmark = pytest.mark.long

STATION = """
name = "pair"
sump.area_m2 = 8.0
pump = [{curve = [36.0, -0.02333, -1.3333e-4]}, {curve = [36.0, -0.02333, -1.3333e-4]}]
rising_main = {static_head_m = 8.0, friction_h2_m5 = 4.0e-4, layout = "common"}
control = {start_levels_m = [1.4, 1.6], stop_levels_m = [0.5, 0.8]}
"""
TAGS = {"level_m": "LT", "inflow_m3h": "FT-001"} | {
    pump_column(pump, quantity): f"P{pump}_{letters}"
    for pump in (1, 2)
    for quantity, letters in {"frequency_hz": "HZ", "head_m": "PT", "power_kw": "JT", "running": "RUN"}.items()
}
MEAN_S = 60


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pair")
    (folder / "pair.toml").write_text(STATION)
    signals = "".join(f'[signal.{name}]\ntag = "{tag}"\n' for name, tag in TAGS.items())
    main = '[signal.main1_flow_m3h]\ntag = "FT-100"\nunit = "l/s"\n'
    head = 'station = "pair"\nlayout = "wide"\nvalue = "{value}"\n[columns]\ntime = "time"\n'
    for value in ("instant", "mean"):
        (folder / f"{value}.toml").write_text(head.format(value=value) + main + signals)
    return folder


@pytest.fixture(scope="module")
def recording(folder):
    """A day in health, with a tenth of the time in which both pumps run."""
    inflow = DiurnalInflow(mean_m3h=120.0, amplitude_m3h=70.0)
    scenario = Scenario(name="day", initial_level_m=1.0, inflow=inflow)
    made = Simulation(load_station(folder / "pair.toml"), scenario, seed=4).advance(86_400)
    both = made.columns["pump1_running"] + made.columns["pump2_running"] > 1.0
    assert 0.05 < both.mean() < 0.2
    return made


def export(path: Path, recording, each=lambda values: values, begin=0, step=1) -> Path:
    """CSV of an export that has the sum of the flows alone."""
    total = sum(recording.columns[pump_column(pump, "flow_m3h")] for pump in (1, 2)) / 3.6
    columns = [each(total), *(each(recording.columns[name]) for name in TAGS)]
    stamps = map(to_iso, recording.time_ns[begin::step].tolist())
    rows = (f"{stamp},{','.join(map('{:.9g}'.format, row))}\n" for stamp, *row in zip(stamps, *columns, strict=True))
    path.write_text(f"time,FT-100,{','.join(TAGS.values())}\n" + "".join(rows))
    return path


def test_a_pump_has_its_own_flow_where_it_runs_alone_and_none_beside_another(folder, recording):
    made = convert([export(folder / "e.csv", recording)], load_mapping(folder / "instant.toml")).recording
    running = np.array([recording.columns[pump_column(pump, "running")] for pump in (1, 2)])
    for pump in (1, 2):
        name = pump_column(pump, "flow_m3h")
        is_unknown = (running[pump - 1] > 0.0) & (running.sum(axis=0) > 1.0)
        expected = np.where(is_unknown, np.nan, recording.columns[name])
        np.testing.assert_allclose(made.columns[name], expected, rtol=1e-8)


def test_the_mean_of_a_pump_is_that_of_its_own_meter(folder, recording):
    def means(values):
        return values.reshape(-1, MEAN_S).mean(axis=1)

    path = export(folder / "m.csv", recording, means, MEAN_S - 1, MEAN_S)
    made = convert([path], load_mapping(folder / "mean.toml")).recording
    ran = np.array([means(recording.columns[pump_column(pump, "running")]) > 0.0 for pump in (1, 2)])
    for pump in (1, 2):
        name = pump_column(pump, "flow_m3h")
        expected = np.where(ran[pump - 1] & ran[2 - pump], np.nan, means(recording.columns[name]))
        np.testing.assert_allclose(made.columns[name], expected, rtol=1e-8)
        assert np.isfinite(expected).mean() > 0.7


def test_the_health_of_such_a_station_is_seen(folder, recording, run_wetwell):
    """While both run nothing is known of the flow: this may be said, but no fault of pump or main."""
    station, out = ("--station", folder / "pair.toml"), folder / "pair.parquet"
    path = export(folder / "e.csv", recording)
    assert run_wetwell("convert", path, "--mapping", folder / "instant.toml", "--out", out) == 0
    assert np.isnan(read_recording(out).columns["pump1_flow_m3h"]).any()
    assert run_wetwell("detect", "--recording", out, *station, "--out", folder / "v.jsonl") == 0
    verdicts = [json.loads(line) for line in (folder / "v.jsonl").read_text().splitlines()]
    lacking = [verdict for verdict in verdicts if "flow_m3h" in verdict["evidence"].get("missing", ())]
    others = [verdict for verdict in verdicts if verdict not in lacking]
    assert {verdict["state"] for verdict in others} <= {"learning", "unknown", "normal"}
    assert sum(verdict["state"] == "normal" for verdict in others) > 50
    assert lacking
    assert {verdict["state"] for verdict in lacking} <= {"learning", "unknown"}
    assert "nobody measures the flow of each while several pumps run on one main" in str(lacking[-1]["evidence"])
    assert run_wetwell("gap", "diagnose", "--recording", out, *station, "--out", folder / "diagnosis") == 0
    report = json.loads((folder / "diagnosis" / "report.json").read_text())
    assert report["verdict"] == "none"


def test_such_a_meter_that_fails_is_told_by_a_run_alone(folder, recording):
    made = convert([export(folder / "e.csv", recording)], load_mapping(folder / "instant.toml")).recording
    failed_ns = int(made.time_ns[0]) + 18 * 3600 * NS_PER_S
    columns = {
        name: np.where(made.time_ns < failed_ns, values, np.nan) if name.endswith("_flow_m3h") else values
        for name, values in made.columns.items()
    }
    verdicts = Detector("pair", datasheet_of(load_station(folder / "pair.toml"))).judge(
        replace(made, columns=columns)
    )
    told = [verdict for verdict in verdicts if verdict.state == "sensor_fault"]
    assert told
    assert {verdict.asset for verdict in told} == {"sensor:flow_m3h"}
    assert all(verdict.time > failed_ns for verdict in told)
