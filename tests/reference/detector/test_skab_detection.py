"""SKAB has flow only: the detector must say so, blame nobody, and see that the flow is not what it was."""

import importlib.util
from pathlib import Path

import pytest

PATH = Path(__file__).parents[3] / "benchmarks" / "real_data.py"


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location("real_data_benchmark", PATH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.real_data
@pytest.mark.parametrize("folder", ["anomaly-free", "valve1", "valve2", "other"])
def test_a_rig_with_flow_only_is_never_blamed(real_data, benchmark, folder):
    paths = sorted((real_data / "skab").rglob(f"{folder}/*.csv.gz"))
    assert paths, f"no {folder}/*.csv.gz under {real_data / 'skab'}"
    for path in paths:
        verdicts, _ = benchmark.skab(path)
        assert {verdict.state for verdict in verdicts} == {"learning", "unknown"}, path
        for verdict in verdicts[1:]:
            assert verdict.state == "unknown", path
            assert {"frequency_hz", "head_m"} <= set(verdict.evidence["missing"]), path
            assert verdict.evidence["reason"].startswith("without frequency_hz, head_m pump and system"), path


@pytest.mark.real_data
@pytest.mark.parametrize("group", ["valve before the pump", "valve after the pump"])
def test_a_valve_that_closes_is_abnormal_within_two_minutes(real_data, benchmark, group):
    told = [benchmark.skab(real_data / "skab" / f"{name}.csv.gz")[1] for name in benchmark.SKAB_GROUPS[group]]
    assert not any(figures["before"] for figures in told)
    assert sum(figures["delay_s"] is not None and figures["delay_s"] < 120 for figures in told) >= len(told) - 1


@pytest.mark.real_data
def test_the_file_without_anomaly_is_normal_throughout(real_data, benchmark):
    verdicts, figures = benchmark.skab(real_data / "skab" / "anomaly-free" / "anomaly-free.csv.gz")
    assert figures["abnormal"] == 0
    assert verdicts[-1].evidence["abnormal"] is False
