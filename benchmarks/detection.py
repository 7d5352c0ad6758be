"""Quality of the detector and its baselines on simulated stations: one JSON object on standard output.

    python benchmarks/detection.py --seeds 20 --first-seed 1000
    python benchmarks/detection.py --seeds 2 --only nominal --detectors wetwell,paper_f_shift

Seeds below 100 are for looking while a detector is changed; figures are told of seeds from 1000 on.
"""

import argparse
import importlib.metadata
import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import LEARNING_S, NS_PER_S
from wetwell.services.batch.backtest import SimulatedRecording, detector_names, run_backtest
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.faults import Fault
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.inflow.surges import Surges
from wetwell.simulator.scenario import Scenario

DAY_S = 86_400
GAPS_PER_DAY = 4
LONGEST_GAP_S = 2400
STEPS = {
    "m": 0.01,
    "m3h": 0.5,
    "frequency_hz": 0.1,
    "flow_m3h": 0.5,
    "head_m": 0.05,
    "power_kw": 0.05,
    "running": 1.0,
}
"""What the readings of a historian are rounded to, by quantity; `level_m` and `inflow_m3h` end in the first two."""
LONG_RUNS_AREA_M2 = 300.0
"""Of a wet well in which a pump runs for hours."""


@dataclass(frozen=True, slots=True)
class BiasedRecording(SimulatedRecording):
    """The flow meters of all pumps are wrong by up to 1 %, in a sine of a day."""

    def load(self) -> Recording:
        """Simulate, then bend the measured flows."""
        recording = SimulatedRecording.load(self)
        factor = 1.0 + 0.01 * np.sin(2.0 * np.pi * np.arange(len(recording)) / DAY_S)
        columns = {
            name: values * factor if name.endswith("_flow_m3h") else values
            for name, values in recording.columns.items()
        }
        return replace(recording, columns=columns)


@dataclass(frozen=True, slots=True)
class PolledRecording(SimulatedRecording):
    """A station that is asked once in so many seconds."""

    period_s: int = 1

    def load(self) -> Recording:
        """Simulate, then keep every so manieth row."""
        recording = SimulatedRecording.load(self)
        kept = slice(None, None, self.period_s)
        return replace(
            recording,
            time_ns=recording.time_ns[kept],
            columns={name: values[kept] for name, values in recording.columns.items()},
            truth={name: values[kept] for name, values in recording.truth.items()},
        )


@dataclass(frozen=True, slots=True)
class StoredRecording(PolledRecording):
    """The same as a historian has it: rounded, with gaps, with stamps that are late and rows out of order."""

    def load(self) -> Recording:
        """Simulate, thin, round, tear."""
        recording = PolledRecording.load(self)
        rng = np.random.default_rng([self.seed, self.period_s])
        rows, day_rows = len(recording), DAY_S // self.period_s
        is_kept = np.ones(rows, dtype=bool)
        for _ in range(max(round(GAPS_PER_DAY * rows / day_rows), 1)):
            begin = int(rng.integers(rows))
            is_kept[begin : begin + int(rng.integers(1, LONGEST_GAP_S // self.period_s))] = False
        late_s = rng.integers(0, max(self.period_s // 4, 2), rows)
        place = np.arange(rows) + np.where(rng.random(rows) < 0.01, rng.integers(1, 4, rows), 0)
        order = np.argsort(place + 0.5 * (place > np.arange(rows)), kind="stable")
        order = order[is_kept[order]]
        columns = {
            name: np.round(values / STEPS[name.partition("_")[2]]) * STEPS[name.partition("_")[2]]
            for name, values in recording.columns.items()
        }
        return replace(
            recording,
            time_ns=(recording.time_ns + late_s * NS_PER_S)[order],
            columns={name: values[order] for name, values in columns.items()},
            truth={name: values[order] for name, values in recording.truth.items()},
        )


@dataclass(frozen=True, slots=True)
class MeanRecording(PolledRecording):
    """A station of which means are stored; truth is that of the end of each interval."""

    def load(self) -> Recording:
        """Simulate, then average."""
        recording = SimulatedRecording.load(self)
        rows = len(recording) // self.period_s
        last = np.arange(1, rows + 1) * self.period_s - 1
        return replace(
            recording,
            time_ns=recording.time_ns[last],
            columns={
                name: values[: rows * self.period_s].reshape(rows, -1).mean(axis=1)
                for name, values in recording.columns.items()
            },
            truth={name: values[last] for name, values in recording.truth.items()},
            value="mean",
        )


@dataclass(frozen=True, slots=True)
class HeadlessRecording(PolledRecording):
    """A station without head sensors."""

    def load(self) -> Recording:
        """Simulate, then leave the heads out."""
        recording = PolledRecording.load(self)
        columns = {name: values for name, values in recording.columns.items() if not name.endswith("head_m")}
        return replace(recording, columns=columns)


@dataclass(frozen=True, slots=True)
class Configuration:
    """Stations and scenarios of one row of the table."""

    station: Station
    scenario: Scenario
    kind: Callable[..., SimulatedRecording] = SimulatedRecording
    learning_s: float = LEARNING_S


def configurations() -> dict[str, Configuration]:
    """Rows of the table by name."""
    alpha, paper, nominal = find_station("alpha"), find_scenario("paper"), find_scenario("nominal")
    wet = paper.model_copy(update={"inflow": DiurnalInflow(surges=Surges(flow_m3h=80.0))})
    small = faults(paper, blockage(33_600, 0.05), clogging(0.25))
    both = faults(
        paper, Blockage(pump=1, speed_loss=0.1, start_s=126_400, end_s=148_000, after="clear"), clogging(0.25)
    )
    cleared = faults(
        paper,
        Blockage(pump=1, speed_loss=0.1, start_s=104_400, end_s=126_400, after="clear"),
        PipeClogging(friction_rise=0.8, start_s=104_400, end_s=148_000, after="clear"),
    )
    later = faults(paper, blockage(90_000, 0.4), *paper.fault[1:])
    slow = altered(alpha, sump=alpha.sump.model_dump(exclude_none=True) | {"area_m2": LONG_RUNS_AREA_M2})
    week = faults(
        paper.model_copy(update={"duration_s": 7 * DAY_S, "name": "paper week"}),
        Blockage(pump=1, speed_loss=0.1, start_s=3 * DAY_S, end_s=4 * DAY_S, after="clear"),
        PipeClogging(friction_rise=0.5, start_s=5 * DAY_S, end_s=6 * DAY_S, after="clear"),
    )
    correlated = with_sensors(alpha, correlation=0.95)
    return {
        "paper": Configuration(alpha, paper),
        "pump 5 % of speed, friction +25 %": Configuration(alpha, small),
        "3 % noise": Configuration(with_sensors(alpha, flow_noise=0.03, head_noise=0.03), paper),
        "static head follows the level": Configuration(
            altered(alpha, effect=[{"name": "level_dependent_static_head", "slope": 1.0}]), paper
        ),
        "common header, two and three pumps on at times": Configuration(
            altered(alpha, rising_main=alpha.rising_main.model_dump() | {"layout": "common"}), wet
        ),
        "noise AR(1) 0.95": Configuration(correlated, paper),
        "flow meters ±1 % over the day": Configuration(alpha, later, BiasedRecording, DAY_S),
        "both at once, 10 % of speed and friction +25 %": Configuration(alpha, both),
        "a pump that is cleared while the main clogs": Configuration(alpha, cleared),
        "nominal": Configuration(alpha, nominal),
        "nominal, noise AR(1) 0.95, flow meters ±1 % over the day": Configuration(
            correlated, nominal, BiasedRecording, DAY_S
        ),
        **{
            f"{scenario.name}, polled every {period_s} s": Configuration(
                alpha, scenario, partial(PolledRecording, period_s=period_s)
            )
            for period_s in (5, 10, 30, 60)
            for scenario in (paper, nominal)
        },
        **{
            f"{scenario.name}, without head, polled every {period_s} s": Configuration(
                alpha, scenario, partial(HeadlessRecording, period_s=period_s)
            )
            for period_s in (1, 10)
            for scenario in (paper, nominal)
        },
        **{
            f"{scenario.name}, stored every {period_s} s, rounded, with gaps and late stamps": Configuration(
                alpha, scenario, partial(StoredRecording, period_s=period_s)
            )
            for period_s in (10, 60)
            for scenario in (paper, nominal)
        },
        **{
            f"{scenario.name}, {kind} of 15 min, long runs": Configuration(
                slow, scenario, partial(cls, period_s=900), 2 * DAY_S
            )
            for kind, cls in (("means", MeanRecording), ("instants", PolledRecording))
            for scenario in (week, nominal.model_copy(update={"duration_s": 7 * DAY_S, "name": "nominal week"}))
        },
    }


def blockage(start_s: float, speed_loss: float) -> Blockage:
    return Blockage(pump=1, speed_loss=speed_loss, start_s=start_s, end_s=start_s + 9000.0, after="clear")


def clogging(friction_rise: float) -> PipeClogging:
    return PipeClogging(friction_rise=friction_rise, start_s=126_400, end_s=148_000, after="clear")


def faults(scenario: Scenario, *given: Fault) -> Scenario:
    return scenario.model_copy(update={"fault": given})


def with_sensors(station: Station, **changes: float) -> Station:
    return altered(station, sensors=station.sensors.model_dump() | changes)


def altered(station: Station, **changes: Any) -> Station:
    return Station.model_validate(station.model_dump(exclude_none=True) | changes)


def figures(configuration: Configuration, seeds: range, detectors: list[str], processes: int) -> Mapping[str, Any]:
    """Figures of each detector on one row."""
    sources = [configuration.kind(configuration.station, configuration.scenario, seed) for seed in seeds]
    result = run_backtest(sources, detectors, processes, configuration.learning_s)
    if result["failed"]:
        sys.exit(f"not scored: {result['failed']}")
    return {"learning_h": result["learning_h"], "detectors": result["detectors"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds")
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--detectors", default="all", help="names with commas between")
    parser.add_argument("--only", action="append", choices=list(configurations()), help="one row; may be given again")
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    detectors = detector_names(arguments.detectors)
    rows = {name: row for name, row in configurations().items() if name in (arguments.only or configurations())}
    about = {
        "benchmark": "detection",
        "version": importlib.metadata.version("wetwell"),
        "seeds": [seeds[0], seeds[-1]],
        "cores": os.cpu_count(),
        "processes": arguments.processes,
    }
    done = {}
    for name, row in rows.items():
        print(name, file=sys.stderr)
        done[name] = figures(row, seeds, detectors, arguments.processes)
    print(json.dumps(about | {"configurations": done}, indent=2))


if __name__ == "__main__":
    main()
