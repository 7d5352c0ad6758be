"""Quality of the detector on simulated stations: one JSON object on standard output.

    python benchmarks/detection.py --seeds 10 --first-seed 1000

Seeds below 100 are for looking while the detector is changed; figures are told of seeds from 1000 on.
"""

import argparse
import importlib.metadata
import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, SupportsFloat

import numpy as np

from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.detector.scoring import (
    FalseAlarms,
    ScoredRun,
    detection_delay_s,
    false_alarms,
    macro_f1,
    poisson_interval,
    precision_and_recall,
    scored_runs,
)
from wetwell.protocols.messages import State, Verdict
from wetwell.protocols.station import Station
from wetwell.services.presets import find_scenario, find_station
from wetwell.simulator.faults.blockage import Blockage
from wetwell.simulator.faults.pipe_clogging import PipeClogging
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.inflow.surges import Surges
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

CHUNK_S = 3600
FAULTS: tuple[State, ...] = ("pump_fault", "system_fault")


@dataclass(frozen=True)
class Outcome:
    """What one seed gave."""

    runs: list[ScoredRun]
    alarms: FalseAlarms
    delays_s: dict[State, float | None]
    samples: int
    judging_s: float


def configurations() -> dict[str, tuple[Station, Scenario]]:
    """Stations and scenarios by name."""
    station, paper = find_station("alpha"), find_scenario("paper")
    noisy = station.sensors.model_copy(update={"flow_noise": 0.03, "head_noise": 0.03})
    common = station.rising_main.model_copy(update={"layout": "common"})
    small = (
        Blockage(pump=1, speed_loss=0.05, start_s=33_600, end_s=42_600, after="clear"),
        PipeClogging(friction_rise=0.25, start_s=126_400, end_s=148_000, after="clear"),
    )
    wet = DiurnalInflow(surges=Surges(flow_m3h=80.0))
    return {
        "paper": (station, paper),
        "pump 5 % of speed, friction +25 %": (station, paper.model_copy(update={"fault": small})),
        "3 % noise": (station.model_copy(update={"sensors": noisy}), paper),
        "common header, two and three pumps on at times": (
            station.model_copy(update={"rising_main": common}),
            paper.model_copy(update={"inflow": wet}),
        ),
        "nominal": (station, find_scenario("nominal")),
    }


def outcome(name: str, seed: int) -> Outcome:
    """Simulate one seed of a configuration, judge it, then score it."""
    station, scenario = configurations()[name]
    recording = Simulation(station, scenario, seed).advance(int(scenario.duration_s))
    detector = Detector(station.name, nominal_of(station))
    stream = recording.samples(station.name)
    verdicts: list[Verdict] = []
    judging_s = 0.0
    for _ in range(0, len(recording), CHUNK_S):
        chunk = [sample for sample, _ in zip(stream, range(CHUNK_S), strict=False)]
        started_s = time.perf_counter()
        for sample in chunk:
            verdicts.extend(detector.update(sample))
        judging_s += time.perf_counter() - started_s
    verdicts.extend(detector.finish())
    return Outcome(
        runs=scored_runs(verdicts, recording),
        alarms=false_alarms(verdicts, recording),
        delays_s={state: detection_delay_s(verdicts, recording, state) for state in FAULTS},
        samples=len(recording),
        judging_s=judging_s,
    )


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Figures of one configuration over its seeds."""
    scores = [macro_f1(one.runs) for one in outcomes]
    runs = [run for one in outcomes for run in one.runs]
    count = sum(one.alarms.count for one in outcomes)
    days = sum(one.alarms.station_days for one in outcomes)
    states = sorted({run.truth for run in runs})
    delays_s = {state: [one.delays_s[state] for one in outcomes] for state in FAULTS if state in states}
    return {
        "macro_f1": {"mean": _rounded(np.mean(scores)), "quantile_5": _rounded(np.quantile(scores, 0.05))},
        "states": {
            state: dict(zip(("precision", "recall"), map(_rounded, precision_and_recall(runs, state)), strict=True))
            for state in states
        },
        "false_alarms": {
            "count": count,
            "station_days": _rounded(days),
            "per_station_day": _rounded(count / days),
            "interval_95": [_rounded(limit) for limit in poisson_interval(count, days)],
        },
        "detection_delay_s": {
            state: {
                "median": float(np.median([np.inf if delay is None else delay for delay in delays])),
                "missed": delays.count(None),
            }
            for state, delays in delays_s.items()
        },
        "abstention_share": _rounded(sum(run.told == "unknown" for run in runs) / len(runs)),
        "runs": len(runs),
        "station_samples_per_s": round(sum(one.samples for one in outcomes) / sum(one.judging_s for one in outcomes)),
    }


def _rounded(value: SupportsFloat) -> float:
    return round(float(value), 4)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds")
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    with ProcessPoolExecutor(arguments.processes) as pool:
        figures = {name: summary(list(pool.map(partial(outcome, name), seeds))) for name in configurations()}
    about = {
        "benchmark": "detection",
        "version": importlib.metadata.version("wetwell"),
        "seeds": [seeds[0], seeds[-1]],
        "cores": os.cpu_count(),
        "processes": arguments.processes,
    }
    print(json.dumps(about | {"configurations": figures}, indent=2))


if __name__ == "__main__":
    main()
