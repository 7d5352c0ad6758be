"""What an operator does at the plants that stand for reality."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.orders import Step
from wetwell.sim2real.truth import sampling
from wetwell.sim2real.truth.elastic import stations
from wetwell.sim2real.truth.elastic.plant import run_elastic
from wetwell.sim2real.truth.storage import Storage, stored
from wetwell.sim2real.truth.truth_plant import run

PLANTS = {"fine": (sampling.case_of, run), "elastic": (stations.case_of, run_elastic)}


@pytest.mark.parametrize("plant", ["fine", pytest.param("elastic", marks=pytest.mark.long)])
def test_both_plants_obey_and_tell_it(plant):
    case_of, run_case = PLANTS[plant]
    case = case_of((), "s", np.random.default_rng(3), seconds=2400)
    pumps = len(case.station.pump)
    nominal_hz = case.station.pump[0].nominal_frequency_hz
    others = (0.0,) * (pumps - 1)
    steps = (
        Step(longest_s=1200, speed_ratio=(0.0, *others), high_m=case.station.control.start_levels_m[0]),
        Step(longest_s=60, speed_ratio=(0.85, *others)),
        Step(longest_s=60, speed_ratio=(0.85, *others), is_valve_shut=True),
        Step(longest_s=60, speed_ratio=(0.9, *others), is_inlet_shut=True),
    )
    seen = run_case(replace(case, steps=steps), truth=False)
    by_hand = seen.column("by_hand") > 0.0
    shut, inlet_shut = seen.column("valve_open") == 0.0, seen.column("inlet_open") == 0.0
    assert by_hand[1]
    assert not by_hand[-1]
    assert (shut.sum(), inlet_shut.sum()) == (60, 60)
    frequency_hz, flow_m3h = seen.column("pump1_frequency_hz"), seen.column("pump1_flow_m3h")
    settled = np.flatnonzero(shut)[20:]
    assert frequency_hz[settled] == pytest.approx(np.full(settled.size, 0.85 * nominal_hz))
    before = flow_m3h[settled[0] - 30]
    assert before > 10.0
    assert flow_m3h[settled].max() < 0.02 * before
    assert seen.column("inflow_m3h")[inlet_shut].max() == 0.0
    assert seen.column("inflow_m3h")[~inlet_shut].min() > 0.0
    for i in range(2, pumps + 1):
        assert not seen.column(f"pump{i}_frequency_hz")[by_hand].any()


def test_a_historian_keeps_what_a_crew_did():
    case = sampling.case_of((), "s", np.random.default_rng(3), seconds=1200)
    steps = (Step(longest_s=300, speed_ratio=(0.0,) * len(case.station.pump), is_inlet_shut=True),)
    kept = stored(run(replace(case, steps=steps)), Storage(every_s=10))
    assert kept.column("by_hand").sum() == pytest.approx(30, abs=1)
    assert np.array_equal(kept.column("by_hand"), 1.0 - kept.column("inlet_open"))
