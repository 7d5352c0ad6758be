"""WHUT's pipeline rig, one to five pumps in series at a steady duty: real meters, healthy pumps, no fault told."""

import gzip
import itertools
from pathlib import Path

import numpy as np
import pytest

from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.detector.posterior import FAULTS
from wetwell.protocols.readings import PumpRow, Row
from wetwell.protocols.stamps import NS_PER_S
from wetwell.protocols.station import Station

METRES_PER_MPA = 101.97
RATE_HZ = 10
RUN_S = 100
IDLE_S = 60
LEARNING_RUNS = 160
"""More than six hours of a run and a rest in turn."""


def readings(path: Path) -> np.ndarray:
    """(n, 2) flow and head by the second, as the rig's first flow meter and pressure gauge show them."""
    with gzip.open(path, "rt") as file:
        names = file.readline().strip().split(",")
        wanted = [names.index("flow1"), names.index("pre1")]
        rows = [[float(cell) for cell in np.array(line.split(","))[wanted]] for line in file if line.strip(", \n")]
    seconds = len(rows) // RATE_HZ
    by_second = np.array(rows[: seconds * RATE_HZ]).reshape(seconds, RATE_HZ, 2).mean(axis=1)
    return by_second * [1.0, METRES_PER_MPA]


@pytest.mark.real_data
@pytest.mark.parametrize("pumps", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("learns_from", ["every other run", "the first half"])
def test_a_healthy_rig_is_not_blamed(real_data, pumps, learns_from):
    """With five pumps the flow falls by 1 % in ten minutes; from the first half alone nobody can foresee that."""
    (path,) = (real_data / "whut-pipeline").glob(f"{pumps}beng*.csv.gz")
    flow_m3h, head_m = readings(path).T
    rig = Station.model_validate(
        {
            "name": "whut",
            "sump": {"area_m2": 1.0},
            "pump": [{"curve": [20.0 * pumps, 0.0, -0.3 * pumps]}],
            "rising_main": {"static_head_m": 0.0, "friction_h2_m5": 0.2765 * METRES_PER_MPA},
        }
    )
    runs = [slice(begin, begin + RUN_S) for begin in range(0, len(flow_m3h) - RUN_S + 1, RUN_S)]
    half = len(runs) // 2
    is_alternate = learns_from == "every other run"
    learnt, unseen = (runs[::2], runs[1::2]) if is_alternate else (runs[:half], runs[half:])
    detector = Detector(rig.name, nominal_of(rig))
    second, verdicts = itertools.count(), []
    for run in [*itertools.islice(itertools.cycle(learnt), LEARNING_RUNS), *unseen]:
        rows = [PumpRow(50.0, q, h, np.nan, True) for q, h in zip(flow_m3h[run], head_m[run], strict=True)]
        for row in rows + [PumpRow(0.0, 0.0, 0.0, np.nan, False)] * IDLE_S:
            at = next(second)
            verdicts += detector.update(Row(at, at * NS_PER_S, np.nan, np.nan, (row,)))
    judged = [verdict for verdict in verdicts if verdict.state != "learning"]
    assert len(judged) > len(unseen)
    assert not [verdict for verdict in judged if verdict.state in FAULTS]
