"""WHUT's pipeline rig, one to five pumps in series at a steady duty: real meters, healthy pumps, no fault told."""

import importlib.util
from pathlib import Path

import pytest

from wetwell.detector.inference.posterior import FAULT_STATES

PATH = Path(__file__).parents[3] / "benchmarks" / "real_data.py"


@pytest.mark.real_data
@pytest.mark.parametrize("pumps", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("learns_from", ["every other run", "the first half"])
def test_a_healthy_rig_is_not_blamed(real_data, pumps, learns_from):
    """With five pumps the flow falls by 1 % in ten minutes, which the first half alone does not let foresee."""
    spec = importlib.util.spec_from_file_location("real_data_benchmark", PATH)
    benchmark = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    judged = benchmark.whut(real_data / "whut-pipeline", pumps, learns_from)
    assert len(judged) >= 2
    assert not [verdict for verdict in judged if verdict.state in (*FAULT_STATES, "sensor_fault", "learning")]
