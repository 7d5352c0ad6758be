"""The paper's 81 cycles, as its benchmark makes them: what both methods reach as written, and why it is so little."""

import importlib.util
from pathlib import Path

import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.evaluation.methods import detector_class
from wetwell.services.stations import find_station

PATH = Path(__file__).parents[3] / "benchmarks" / "paper_cycles.py"
FIRST_SEED = 5000


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location("paper_cycles_benchmark", PATH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def station(benchmark):
    return benchmark.with_friction(find_station("alpha"))


@pytest.fixture(scope="module")
def recording(benchmark, station):
    ((_, recording),) = benchmark.recordings(station, FIRST_SEED, 1)
    return recording


def told(benchmark, make, station, recording):
    return benchmark.score([benchmark.judged(make(station.name, datasheet_of(station)), recording)])


@pytest.mark.parametrize("name", ["paper_f_test", "paper_tangent"])
def test_as_written_neither_method_is_much_better_than_always_normal(benchmark, station, recording, name):
    assert told(benchmark, detector_class(name), station, recording)["f1"] < 0.5


def test_a_null_fixed_at_healthy_cycles_sees_the_faults_whichever_side_it_blames(benchmark, station, recording):
    table = told(benchmark, benchmark.NominalNullFTest, station, recording)["truth_by_told"]
    assert table["pump_fault"]["normal"] + table["system_fault"]["normal"] <= 2
    assert table["normal"]["normal"] >= 0.8 * sum(table["normal"].values())


def test_the_detector_tells_them(benchmark, station, recording):
    assert told(benchmark, detector_class("wetwell"), station, recording)["f1"] > 0.9


def test_within_a_cycle_there_is_next_to_nothing_to_see(benchmark, station, recording):
    for figures in benchmark.reasons(station, recording).values():
        assert figures["signal_to_noise_of_a_step"] < 0.01
        assert figures["drift_within_a_cycle_m"] < 0.1 * figures["shift_between_cycles_m"]
