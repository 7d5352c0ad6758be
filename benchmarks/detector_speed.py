"""Speed and memory of the detector, its F-tests side by side with statsmodels: one JSON object on standard output.

    python benchmarks/detector_speed.py

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
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from timing import least_s

from wetwell.detector.curve_drift import RollingFTest
from wetwell.detector.gate import Gate
from wetwell.detector.nominal import Nominal, nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.detector.pump_record import ROLLING_SAMPLES
from wetwell.protocols.messages import Sample
from wetwell.protocols.recording import Recording
from wetwell.services.presets import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

DAY_S = 86_400
LIVE_FROM_S = 8 * 3600
"""The learning phase is over."""
LIVE_SAMPLES = 20_000
MEMORY_DAYS = (1, 10, 40)
TESTS = 200

Floats = npt.NDArray[np.float64]


def judge(nominal: Nominal, recording: Recording) -> None:
    """The whole pipeline over a recording."""
    detector = Detector("alpha", nominal)
    for row in recording.rows():
        detector.update(row)
    detector.finish()


def rows_alone(recording: Recording) -> None:
    for _ in recording.rows():
        pass


def gate_alone(nominal: Nominal, recording: Recording) -> None:
    """Rows and gate, without which no sample comes in."""
    gate = Gate(nominal)
    for row in recording.rows():
        gate.update(row)


def decode(payloads: list[bytes]) -> None:
    for payload in payloads:
        Sample.decode(payload)


def live_s(nominal: Nominal, recording: Recording, repeats: int) -> dict[str, float]:
    """Time of a live sample of a station that has learnt: decoded and judged, and decoded alone."""
    payloads = [sample.encode() for sample in recording.samples("alpha")]
    learnt = Detector("alpha", nominal)
    for payload in payloads[:LIVE_FROM_S]:
        learnt.update(Sample.decode(payload))
    state, live = learnt.snapshot(), payloads[LIVE_FROM_S : LIVE_FROM_S + LIVE_SAMPLES]

    def run() -> None:
        detector = Detector("alpha", nominal)
        detector.restore(state)
        for payload in live:
            detector.update(Sample.decode(payload))

    return {
        "whole": least_s(run, repeats) / LIVE_SAMPLES,
        "decoding": least_s(partial(decode, live), repeats) / LIVE_SAMPLES,
    }


def memory_kb(seed: int) -> dict[str, dict[str, float]]:
    """Memory of one detector after some days of one station, as the allocator sees it, and its snapshot. [kB].

    The detector is made anew from its snapshot while its memory is traced: the samples of a day are no part of it.
    """
    station = find_station("alpha")
    nominal = nominal_of(station)
    simulation, detector = Simulation(station, find_scenario("nominal"), seed), Detector("alpha", nominal)
    figures = {}
    for day in range(1, max(MEMORY_DAYS) + 1):
        for row in simulation.advance(DAY_S, truth=False).rows():
            detector.update(row)
        if day not in MEMORY_DAYS:
            continue
        state = detector.snapshot()
        gc.collect()
        tracemalloc.start()
        twin = Detector("alpha", nominal)
        twin.restore(state)
        gc.collect()
        held_bytes = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        figures[f"after_{day}_days"] = {
            "held": round(held_bytes / 1000, 1),
            "snapshot": round(len(twin.snapshot()) / 1000, 1),
        }
    return figures


def steady_samples(recording: Recording) -> Iterator[tuple[float, ...]]:
    """Time, flow, head and speed ratio of the first pump while it runs at full speed."""
    columns = [recording.column(f"pump1_{quantity}") for quantity in ("frequency_hz", "flow_m3h", "head_m")]
    for second, (frequency_hz, flow_m3h, head_m) in enumerate(zip(*(c.tolist() for c in columns), strict=True)):
        if frequency_hz > 49.0:
            yield float(second), flow_m3h, head_m, frequency_hz / 50.0


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
    """Both F-tests over the window of the detector, beside a refit of the same window in statsmodels."""
    samples = list(steady_samples(recording))[: ROLLING_SAMPLES + 5000]
    rolling = RollingFTest(ROLLING_SAMPLES)

    def take() -> None:
        for sample in samples:
            rolling.update(*sample)

    take_s = least_s(take, repeats) / len(samples)
    test_s = least_s(lambda: [rolling.value() for _ in range(TESTS)], repeats) / TESTS
    figures: dict[str, Any] = {"take_a_sample_us": _us(take_s), "pair_of_tests_us": _us(test_s)}
    try:
        import statsmodels.api as sm  # noqa: PLC0415 - no part of the product
    except ImportError:
        return figures | {"statsmodels_refit_us": None}
    window, tests = rolling.samples(), rolling.value()
    refit_s = least_s(lambda: [statsmodels_log_p(sm, window) for _ in range(TESTS)], repeats) / TESTS
    if tests is None:
        raise ValueError("the recording has no window of steady samples")
    difference = np.subtract(statsmodels_log_p(sm, window), (tests.pump.log_p, tests.system.log_p))
    return figures | {
        "statsmodels_refit_us": _us(refit_s),
        "ratio": round(refit_s / test_s, 1),
        "largest_difference_of_log_p": float(f"{np.abs(difference).max():.1e}"),
    }


def _us(seconds: float) -> float:
    return round(seconds * 1e6, 2)


def figures(seed: int, repeats: int) -> dict[str, Any]:
    """All figures of one run."""
    station = find_station("alpha")
    nominal, pumps = nominal_of(station), len(station.pump)
    pipeline = {}
    days = {
        name: Simulation(station, find_scenario(name), seed).advance(DAY_S, truth=False)
        for name in ("nominal", "paper")
    }
    for name, recording in days.items():
        whole_s = least_s(partial(judge, nominal, recording), repeats)
        gate_s = least_s(partial(gate_alone, nominal, recording), repeats)
        rows_s = least_s(partial(rows_alone, recording), repeats)
        pipeline[name] = {
            "k_pump_samples_per_s": round(pumps * len(recording) / whole_s / 1000),
            "station_sample_us": _us(whole_s / len(recording)),
            "of_which_rows_us": _us(rows_s / len(recording)),
            "of_which_rows_and_gate_us": _us(gate_s / len(recording)),
            "limit_of_the_gate_alone_k_pump_samples_per_s": round(pumps * len(recording) / gate_s / 1000),
        }
    return {
        "pipeline": pipeline,
        "live_sample_us": {name: _us(cost_s) for name, cost_s in live_s(nominal, days["paper"], repeats).items()},
        "f_tests": f_tests(days["nominal"], repeats),
        "memory_kb": memory_kb(seed),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=5, help="times that each figure is measured")
    arguments = parser.parse_args()
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
    print(json.dumps(about | figures(arguments.seed, arguments.repeats), indent=2))


if __name__ == "__main__":
    main()
