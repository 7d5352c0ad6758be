"""The paper's 81 cycles of pump 1: confusion matrices of its methods and of ours; one JSON object on standard output.

    python benchmarks/paper_cycles.py --recordings 6

Scenario `paper` on station `alpha` with k = 5e-4, between the two values that the paper gives; the first seeds from
`--first-seed` on with which pump 1 makes 81 cycles in the two days. Cycles of the first six hours are not scored.
"""

import argparse
import itertools
import json
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet, datasheet_of
from wetwell.detector.evaluation.methods import detector_class
from wetwell.detector.evaluation.methods.run_detector import RunDetector
from wetwell.detector.evaluation.scores import (
    ScoredRun,
    confusion,
    f1,
    precision_and_recall,
    scored_runs,
    without_truth,
)
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.f_distribution import log_f_survival
from wetwell.detector.statistics.tangent import tangent_residuals
from wetwell.detector.stream.block import Block, blocks
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import State
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

CYCLES = 81
FRICTION_H2_M5 = 5e-4
LOG_ALPHA = float(np.log(0.05))
STATES: tuple[State, ...] = ("normal", "pump_fault", "system_fault")
METHODS = ("paper_f_test", "paper_f_shift", "paper_tangent", "paper_tangent_segments", "wetwell", "always_normal")
REPORTED = {
    "F-test": {"precision": 0.80, "recall": 0.94, "f1": 0.82},
    "tangent residual": {"precision": 0.981, "recall": 0.852, "f1": 0.895},
}


class NominalNullFTest(RunDetector):
    """Another reading of the first method: the null is the curve fitted to fault-free cycles, with no free parameter.

    The alternative has coefficients that are linear in time, as before. Of two p below 5 % the smaller is told.
    """

    def __init__(self, station: str, datasheet: Datasheet) -> None:
        super().__init__(station, datasheet)
        self._fits: dict[int, list[Floats]] = {}

    def learn(self, pump: int, runs: list[Run]) -> None:
        curves = zip(*(_curves(run) for run in runs), strict=True)
        fits = []
        for curve in curves:
            basis, head_m = (np.concatenate(part) for part in zip(*curve, strict=True))
            fits.append(np.linalg.lstsq(basis, head_m, rcond=None)[0])
        self._fits[pump] = fits

    def told(self, run: Run) -> State:
        logs = []
        for (basis, head_m), fit in zip(_curves(run), self._fits[run.pump], strict=True):
            moving = np.hstack([basis, basis * (run.time_s / run.time_s[-1])[:, np.newaxis]])
            moved = head_m - moving @ np.linalg.lstsq(moving, head_m, rcond=None)[0]
            still, free, samples = head_m - basis @ fit, moving.shape[1], len(head_m)
            f = (still @ still - moved @ moved) / free / (moved @ moved / (samples - free))
            logs.append(float(log_f_survival(f, free, samples - free)))
        if min(logs) >= LOG_ALPHA:
            return "normal"
        return "pump_fault" if logs[0] < logs[1] else "system_fault"


def _curves(run: Run) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Basis and head of the pump curve at nominal speed, and of the system curve."""
    flow, one = run.flow_m3h / run.speed_ratio / 100.0, np.ones(len(run.time_s))
    total = run.total_flow_m3h / 100.0
    return (
        (np.column_stack([one, flow, flow**2]), run.head_m / run.speed_ratio**2),
        (np.column_stack([one, total**2]), run.head_m),
    )


class Cycles(RunDetector):
    """Keeps the steady samples of each cycle of pump 1."""

    def __init__(self, station: str, datasheet: Datasheet) -> None:
        super().__init__(station, datasheet)
        self.runs: list[Run] = []

    def learn(self, pump: int, runs: list[Run]) -> None:
        self.runs += runs if pump == 0 else []

    def told(self, run: Run) -> State:
        self.runs += [run] if run.pump == 0 else []
        return "normal"


def with_friction(station: Station) -> Station:
    """The station with the friction of this benchmark."""
    rising_main = station.rising_main.model_copy(update={"friction_h2_m5": FRICTION_H2_M5})
    return station.model_copy(update={"rising_main": rising_main})


def recordings(station: Station, first_seed: int, count: int) -> Iterator[tuple[int, Recording]]:
    """Seed and recording, where pump 1 makes `CYCLES`."""
    scenario, found = find_scenario("paper"), 0
    for seed in itertools.count(first_seed):
        recording = Simulation(station, scenario, seed).advance(int(scenario.duration_s))
        on = recording.columns["pump1_running"] > 0.0
        if np.count_nonzero(on[1:] & ~on[:-1]) + on[0] == CYCLES:
            yield seed, recording
            found += 1
            if found == count:
                return


def blocks_of(recording: Recording) -> Iterator[Block]:
    """The rows that a detector may see."""
    return blocks(without_truth(recording), recording.pumps)


def judged(detector: Any, recording: Recording) -> list[ScoredRun]:
    """Cycles of pump 1 after learning, as a detector tells them."""
    verdicts = [verdict for block in blocks_of(recording) for verdict in detector.update_block(block)]
    verdicts += detector.finish()
    return [run for run in scored_runs(verdicts, recording) if run.pump == 1]


def score(cycles: list[list[ScoredRun]]) -> dict[str, Any]:
    """Means over the recordings, and the confusion matrix of all of them."""
    figures = [
        [
            (*precision_and_recall(runs, state), f1(runs, state))
            for state in STATES
            if any(r.truth == state for r in runs)
        ]
        for runs in cycles
    ]
    macro = np.array([np.mean(one, axis=0) for one in figures])
    table = confusion(list(itertools.chain(*cycles)))[:3]
    return {
        "precision": round(float(macro[:, 0].mean()), 3),
        "recall": round(float(macro[:, 1].mean()), 3),
        "f1": round(float(macro[:, 2].mean()), 3),
        "f1_range": [round(float(macro[:, 2].min()), 3), round(float(macro[:, 2].max()), 3)],
        "truth_by_told": {
            state: dict(zip((*STATES, "both", "sensor", "unknown", "learning"), row, strict=True))
            for state, row in zip(STATES, table.tolist(), strict=True)
        },
    }


def reasons(station: Station, recording: Recording) -> dict[str, Any]:
    """What the noise does to one-second steps, and how far the curves move within a cycle and between cycles."""
    datasheet = datasheet_of(station)
    keeper = Cycles(station.name, datasheet)
    for block in blocks_of(recording):
        keeper.update_block(block)
    keeper.finish()
    origin_ns = int(recording.time_ns[0])
    figures: dict[str, Any] = {}
    for state, component, span_s in (("pump_fault", 0, (33_600, 42_600)), ("system_fault", 1, (126_400, 148_000))):
        within, between, noise = [], [], []
        healthy = [r for r in keeper.runs if (r.window_ns[1] - origin_ns) / 1e9 < span_s[0]]
        usual_m = np.mean([r.segments.residual_m[:, component].mean() for r in healthy])
        for run in keeper.runs:
            begin_s, end_s = ((stamp - origin_ns) / 1e9 for stamp in run.window_ns)
            if begin_s < span_s[0] or end_s > span_s[1]:
                continue
            steps = tangent_residuals(
                run.flow_m3h,
                run.head_m,
                run.speed_ratio,
                curve=datasheet.curves[0],
                friction_h2_m5=datasheet.main_of(0).friction_h2_m5,
            )
            noise.append(float(np.std(steps[component])))
            between.append(abs(float(run.segments.residual_m[:, component].mean() - usual_m)))
            within.append(run.time_s[-1] - run.time_s[0])
        rate_m_s = max(between) / (span_s[1] - span_s[0])
        figures[state] = {
            "drift_mm_s": round(1e3 * rate_m_s, 3),
            "noise_of_a_step_mm": round(1e3 * float(np.mean(noise)), 1),
            "signal_to_noise_of_a_step": float(f"{rate_m_s / np.mean(noise):.2g}"),
            "drift_within_a_cycle_m": round(rate_m_s * float(np.mean(within)), 3),
            "shift_between_cycles_m": round(float(np.mean(between)), 2),
        }
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=int, default=6)
    parser.add_argument("--first-seed", type=int, default=1000)
    arguments = parser.parse_args()
    station = with_friction(find_station("alpha"))
    classes = {name: detector_class(name) for name in METHODS} | {"nominal_null_f_test": NominalNullFTest}
    cycles: dict[str, list[list[ScoredRun]]] = {name: [] for name in classes}
    seeds, why = [], {}
    for seed, recording in recordings(station, arguments.first_seed, arguments.recordings):
        print(f"seed {seed}", file=sys.stderr)
        seeds.append(seed)
        for name, make in classes.items():
            cycles[name].append(judged(make(station.name, datasheet_of(station)), recording))
        why = why or reasons(station, recording)
    told = {name: score(found) for name, found in cycles.items()}
    print(
        json.dumps(
            {"benchmark": "paper_cycles", "seeds": seeds, "reported": REPORTED, "methods": told, "why": why}, indent=2
        )
    )


if __name__ == "__main__":
    main()
