"""Speed and memory of the detector, its F-tests side by side with statsmodels: one JSON object on standard output.

    python benchmarks/detector_speed.py [--year]

Each time is the least of several, counted by the processor. Ratios are of figures of the same run. Without
statsmodels its figures are null.
"""

import argparse
import gc
import importlib.metadata
import json
import os
import platform
import tracemalloc
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from timing import least_s

from wetwell.detector.curves.datasheet import Datasheet, datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.runs.run_tracker import ROLLING_SAMPLES
from wetwell.detector.statistics.rolling_f_test import LOG_P, RollingFTest, scan
from wetwell.detector.stream.block import blocks
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

DAY_S = 86_400
LIVE_FROM_S = 8 * 3600
"""The learning phase is over."""
LIVE_SAMPLES = 20_000
MEMORY_DAYS = (1, 10, 40)
YEAR_DAYS = 365
REFITS = 200


def judge(datasheet: Datasheet, recording: Recording) -> None:
    """The whole pipeline over a recording, as `wetwell detect` has it."""
    detector = Detector("alpha", datasheet)
    for block in blocks(recording, datasheet.pumps):
        detector.update_block(block)
    detector.finish()


def judge_by_samples(datasheet: Datasheet, recording: Recording) -> None:
    """The same, a sample at a time."""
    detector = Detector("alpha", datasheet)
    for row in recording.rows():
        detector.update(row)
    detector.finish()


def blocks_alone(datasheet: Datasheet, recording: Recording) -> None:
    for _ in blocks(recording, datasheet.pumps):
        pass


def decode(payloads: list[bytes]) -> None:
    for payload in payloads:
        Sample.decode(payload)


def live_s(datasheet: Datasheet, recording: Recording, repeats: int) -> dict[str, float]:
    """Time of a live sample of a station that has learnt: decoded and judged, and decoded alone."""
    payloads = [sample.encode() for sample in recording.samples("alpha")]
    learnt = Detector("alpha", datasheet)
    for payload in payloads[:LIVE_FROM_S]:
        learnt.update(Sample.decode(payload))
    state, live = learnt.snapshot(), payloads[LIVE_FROM_S : LIVE_FROM_S + LIVE_SAMPLES]

    def run() -> None:
        detector = Detector("alpha", datasheet)
        detector.restore(state)
        for payload in live:
            detector.update(Sample.decode(payload))

    return {
        "whole": least_s(run, repeats) / LIVE_SAMPLES,
        "decoding": least_s(partial(decode, live), repeats) / LIVE_SAMPLES,
    }


def memory_kb(seed: int, days: Sequence[int]) -> dict[str, dict[str, float]]:
    """Memory of one detector after some days of one station, as the allocator sees it, and its snapshot. [kB].

    The detector is made anew from its snapshot while its memory is traced: the samples of a day are no part of it.
    """
    station = find_station("alpha")
    datasheet = datasheet_of(station)
    simulation, detector = Simulation(station, find_scenario("nominal"), seed), Detector("alpha", datasheet)
    figures = {}
    largest = 0.0
    for day in range(1, max(days) + 1):
        for block in blocks(simulation.advance(DAY_S, truth=False), datasheet.pumps):
            detector.update_block(block)
        state = detector.snapshot()
        gc.collect()
        tracemalloc.start()
        twin = Detector("alpha", datasheet)
        twin.restore(state)
        gc.collect()
        held_bytes = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        largest = max(largest, held_bytes / 1000)
        if day not in days:
            continue
        figures[f"after_{day}_days"] = {
            "held": round(held_bytes / 1000, 1),
            "snapshot": round(len(state) / 1000, 1),
            "most_held_so_far": round(largest, 1),
        }
    return figures


def steady_samples(recording: Recording) -> Floats:
    """(5, n) time, flow, head, speed ratio and total flow of the first pump while it runs at full speed."""
    frequency_hz, flow_m3h, head_m = (
        recording.column(f"pump1_{quantity}") for quantity in ("frequency_hz", "flow_m3h", "head_m")
    )
    columns = np.array([np.arange(float(len(recording))), flow_m3h, head_m, frequency_hz / 50.0, flow_m3h])
    steady: Floats = np.ascontiguousarray(columns[:, frequency_hz > 49.0])
    return steady


def statsmodels_log_p(sm: Any, window: Floats) -> tuple[float, float]:
    """Log p of both tests by a refit of the four models in statsmodels."""
    time_s, flow_m3h, head_m, speed_ratio = window[:4]
    t, q, q2 = (
        (values - values.mean()) / values.std() for values in (time_s, flow_m3h / speed_ratio, flow_m3h * flow_m3h)
    )
    log_p = []
    for response, variable, degree in ((head_m / speed_ratio**2, q, 2), (head_m, q2, 1)):
        null = np.vander(variable, degree + 1, increasing=True)
        restricted = sm.OLS(response, null).fit()
        full = sm.OLS(response, np.column_stack([null, null * t[:, None]])).fit()
        log_p.append(float(np.log(full.compare_f_test(restricted)[1])))
    return log_p[0], log_p[1]


def f_tests(recording: Recording, repeats: int) -> dict[str, Any]:
    """Both F-tests after each sample over the window of the detector, beside a refit of it in statsmodels."""
    samples = steady_samples(recording)
    rolling = RollingFTest(ROLLING_SAMPLES)
    for sample in samples.T.tolist():
        rolling.update(*sample)
    scan_s = least_s(lambda: scan(samples, ROLLING_SAMPLES), repeats) / samples.shape[1]
    test_s = least_s(lambda: [rolling.value() for _ in range(REFITS)], repeats) / REFITS
    figures: dict[str, Any] = {
        "samples": samples.shape[1],
        "rolling_pair_us": _us(scan_s),
        "pair_when_a_verdict_asks_us": _us(test_s),
    }
    try:
        import statsmodels.api as sm  # noqa: PLC0415 - no part of the product
    except ImportError:
        return figures | {"statsmodels_refit_us": None}
    found = scan(samples, ROLLING_SAMPLES)[:, :, LOG_P]
    last = range(ROLLING_SAMPLES, samples.shape[1] + 1, max((samples.shape[1] - ROLLING_SAMPLES) // REFITS, 1))
    windows = [samples[:, end - ROLLING_SAMPLES : end] for end in last]
    refits = [statsmodels_log_p(sm, window) for window in windows]
    refit_s = least_s(lambda: [statsmodels_log_p(sm, window) for window in windows], repeats) / len(windows)
    return figures | {
        "statsmodels_refit_us": _us(refit_s),
        "ratio": round(refit_s / scan_s),
        "largest_difference_of_log_p": float(f"{np.abs(found[[end - 1 for end in last]] - refits).max():.1e}"),
    }


def _us(seconds: float) -> float:
    return round(seconds * 1e6, 2)


def pipeline(station: Station, scenario: str, seed: int, repeats: int) -> dict[str, float]:
    """Speed of the whole pipeline over a day of a station."""
    datasheet, pumps = datasheet_of(station), len(station.pump)
    recording = Simulation(station, find_scenario(scenario), seed).advance(DAY_S, truth=False)
    whole_s = least_s(partial(judge, datasheet, recording), repeats)
    single_s = least_s(partial(judge_by_samples, datasheet, recording), repeats)
    blocks_s = least_s(partial(blocks_alone, datasheet, recording), repeats)
    return {
        "k_pump_samples_per_s": round(pumps * len(recording) / whole_s / 1000),
        "station_sample_us": _us(whole_s / len(recording)),
        "of_which_columns_to_blocks_us": _us(blocks_s / len(recording)),
        "k_pump_samples_per_s_one_by_one": round(pumps * len(recording) / single_s / 1000),
    }


def figures(seed: int, repeats: int, days: Sequence[int]) -> dict[str, Any]:
    """All figures of one run."""
    station = find_station("alpha")
    main = station.rising_main.model_copy(update={"layout": "common"})
    control = station.control.model_copy(update={"mode": "pid", "min_frequency_hz": 25.0})
    by_speed = station.model_copy(update={"rising_main": main, "control": control})
    day = {
        name: Simulation(station, find_scenario(name), seed).advance(DAY_S, truth=False)
        for name in ("nominal", "paper")
    }
    return {
        "pipeline": {
            "nominal": pipeline(station, "nominal", seed, repeats),
            "paper": pipeline(station, "paper", seed, repeats),
            "nominal, PID on a common header": pipeline(by_speed, "nominal", seed, repeats),
        },
        "live_sample_us": {
            name: _us(cost_s) for name, cost_s in live_s(datasheet_of(station), day["paper"], repeats).items()
        },
        "f_tests": f_tests(day["nominal"], repeats),
        "memory_kb": memory_kb(seed, days),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=5, help="times that each figure is measured")
    parser.add_argument("--year", action="store_true", help="watch the memory for 365 days instead of 40; minutes")
    arguments = parser.parse_args()
    days = (*MEMORY_DAYS, YEAR_DAYS) if arguments.year else MEMORY_DAYS
    about = {
        "benchmark": "detector_speed",
        "version": importlib.metadata.version("wetwell"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": platform.machine(),
        "cores": os.cpu_count(),
        "seed": arguments.seed,
        "repeats": arguments.repeats,
    }
    print(json.dumps(about | figures(arguments.seed, arguments.repeats, days), indent=2))


if __name__ == "__main__":
    main()
