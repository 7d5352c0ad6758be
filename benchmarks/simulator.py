"""Speed of the simulator, side by side with Python and EPA SWMM 5: one JSON object on standard output.

    python benchmarks/simulator.py

Each time is the least of several, counted by the processor; ensemble, start-up and fleet are timed on the wall, once.
Ratios are of figures of the same run. Without pyswmm its figures are null.
"""

import argparse
import contextlib
import importlib.metadata
import json
import math
import multiprocessing
import os
import platform
import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from swmm_station import INFLOW_STEP_S, swmm_input
from timing import least_s

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.forcing import healthy_forcing
from wetwell.simulator.plant import Plant
from wetwell.simulator.simulation import Simulation

DAY_S = 86_400
BLOCK_S = 3600
LIVE_S = 2000
FLEET = 1000
FLEET_TICKS = 30
FLEET_BEGIN_S = 1800
MOST_M3H = 1000.0
"""Upper end of the bisection's bracket."""
KERNEL_REPEATS = 20
"""A day in the kernel takes milliseconds: more of them, so that a burst of other work on the machine is outlasted."""
MEMORY_DAYS = 26
PYTHON_S = 7200
STORM_M3H = 700.0
"""More than three pumps take: all run."""
SIX_EFFECTS: tuple[dict[str, Any], ...] = (
    {"name": "ragging", "speed_loss": 0.05},
    {"name": "motor_slip", "slip": 0.02},
    {"name": "check_valve_leak", "leak_m3h": 2.0},
    {"name": "air_pocket", "head_m": 0.5},
    {"name": "flow_meter_lag", "lag_s": 5.0},
    {"name": "level_quantisation", "quantum_m": 0.01},
)

T = TypeVar("T")


def one_pump(station: Station) -> Station:
    """The station with its first pump alone."""
    control = station.control
    levels = {"start_levels_m": control.start_levels_m[:1], "stop_levels_m": control.stop_levels_m[:1]}
    return station.model_copy(
        update={"pump": station.pump[:1], "control": control.model_copy(update=levels), "effect": ()}
    )


def kernel_s(station: Station, inflow_m3h: Floats, seed: int, repeats: int) -> float:
    """Time of a day in the kernel, in blocks of an hour."""
    from wetwell.simulator.effects import effective_parameters  # noqa: PLC0415 - the benchmark runs without, too

    parts = len(station.pump), len(station.mains)
    blocks = [healthy_forcing(block_m3h, *parts) for block_m3h in np.split(inflow_m3h, inflow_m3h.size // BLOCK_S)]
    plant, rng = Plant(effective_parameters(station), 1.0), np.random.default_rng(seed)

    def run() -> None:
        for forcing in blocks:
            plant.advance(forcing, rng)

    run()
    return least_s(run, KERNEL_REPEATS * repeats)


@numba.njit  # type: ignore[untyped-decorator]
def sum_of_normals(rng: np.random.Generator, count: int) -> float:
    total = 0.0
    for _ in range(count):
        total += rng.standard_normal()
    return total


def normals_s(station: Station, seed: int, repeats: int) -> float:
    """Time of the normal deviates alone that a day of the station draws: two a second, three for each active pump."""
    truth = Simulation(station, find_scenario("nominal"), seed).advance(DAY_S).truth
    active = sum(np.count_nonzero(truth[f"truth_pump{i + 1}_flow_m3h"]) for i in range(len(station.pump)))
    rng = np.random.default_rng(seed)
    sum_of_normals(rng, 1)
    return least_s(lambda: sum_of_normals(rng, 2 * DAY_S + 3 * active), repeats)


def day(station: Station, seed: int, *, truth: bool) -> float:
    """Simulate a day; the last level."""
    recording = Simulation(station, find_scenario("nominal"), seed).advance(DAY_S, truth=truth)
    return float(recording.columns["level_m"][-1])


def live_s(station: Station, seed: int, repeats: int) -> float:
    """Time of one live second."""
    simulation = Simulation(station, find_scenario("nominal"), seed)
    return least_s(lambda: [simulation.advance(1, truth=False) for _ in range(LIVE_S)], repeats) / LIVE_S


def live_fleet(station: Station, seed: int) -> dict[str, float]:
    """A thousand stations that each advance by one second each second on the wall, in one process."""
    fleet = [Simulation(station, find_scenario("nominal"), seed + i) for i in range(FLEET)]
    for simulation in fleet:
        simulation.advance(FLEET_BEGIN_S)  # to where pumps run
    late_s, busy_s = [], []
    began_s, began_cpu_s = time.perf_counter(), time.process_time()
    for tick in range(FLEET_TICKS):
        due_s = began_s + tick
        time.sleep(max(due_s - time.perf_counter(), 0.0))
        woke_s = time.perf_counter()
        late_s.append(woke_s - due_s)
        for simulation in fleet:
            simulation.advance(1, truth=False)
        busy_s.append(time.perf_counter() - woke_s)
    time.sleep(max(began_s + FLEET_TICKS - time.perf_counter(), 0.0))
    wall_s = time.perf_counter() - began_s
    return {
        "stations": FLEET,
        "wall_s": round(wall_s, 1),
        "share_of_a_core": round((time.process_time() - began_cpu_s) / wall_s, 4),
        "longest_tick_s": round(max(busy_s), 3),
        "latest_tick_s": round(max(late_s), 3),
        "memory_mb": round(peak_mb()),
    }


def ensemble_rate(station: Station, seeds: range, processes: int) -> float:
    """Station-seconds a second of days of many seeds on all cores."""
    with ProcessPoolExecutor(processes) as pool:
        list(pool.map(partial(day, station, truth=False), range(processes)))
        started_s = time.perf_counter()
        list(pool.map(partial(day, station, truth=False), seeds, chunksize=max(1, len(seeds) // (4 * processes))))
        return len(seeds) * DAY_S / (time.perf_counter() - started_s)


def first_step() -> tuple[float, float]:
    """Time of the first second of a process, the kernel coming from its cache, and the clock after it."""
    station, scenario = find_station("alpha"), find_scenario("nominal")
    started_s = time.perf_counter()
    Simulation(station, scenario, 1).advance(1)
    return time.perf_counter() - started_s, time.time()


def peak_mb() -> float:
    """Largest memory of this process so far. [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


def kept_mb(*, truth: bool) -> float:
    """Largest memory of a process that simulates and keeps 26 days. [MB]."""
    recording = Simulation(find_station("alpha"), find_scenario("nominal"), 1).advance(
        MEMORY_DAYS * DAY_S, truth=truth
    )
    return peak_mb() if len(recording) else math.nan


def in_fresh_process(function: Callable[[], T]) -> T:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function).result()


def start_up() -> dict[str, float]:
    """From the start of a process to its first second; the second of two, so that the cache is warm."""
    in_fresh_process(first_step)
    started_s = time.time()
    step_s, ended_s = in_fresh_process(first_step)
    return {"process_to_first_step_s": round(ended_s - started_s, 2), "first_step_s": round(step_s, 3)}


def own_bisection_m3h(lift_m: float, linear: float, square: float) -> float:
    """Flow at which the excess head lift + linear Q + square Q² is gone, by a bisection written out."""
    low, high = 0.0, MOST_M3H
    while high - low > 1e-10:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if lift_m + (linear + square * middle) * middle > 0.0 else (low, middle)
    return low


def scipy_bisection_m3h(bisect: Callable[..., float], lift_m: float, linear: float, square: float) -> float:
    """The same by `scipy.optimize.bisect` with its own tolerance, as most people write it."""
    return float(bisect(lambda flow_m3h: lift_m + (linear + square * flow_m3h) * flow_m3h, 0.0, MOST_M3H))


def python_s(
    station: Station, inflow_m3h: Floats, seed: int, solve_m3h: Callable[[float, float, float], float]
) -> float:
    """Time of the same station in plain Python, a duty point for each running pump a second; the inflow is given."""
    rng, sensors = random.Random(seed), station.sensors
    static_m, friction = station.rising_main.static_head_m, station.rising_main.friction_h2_m5
    start_m, stop_m = station.control.start_levels_m, station.control.stop_levels_m
    nominal_hz, rate_hz = station.pump[0].nominal_frequency_hz, 50.0 / station.control.ramp_s
    curves = [pump.coefficients for pump in station.pump]
    power_kw = math.sqrt(3.0) * station.electrical.voltage_v * station.electrical.rated_current_a / 1000.0
    power_kw *= station.electrical.power_factor
    frequencies_hz, running, turn, level_m, rows = [0.0] * len(curves), [], 0, 1.0, []

    def duty_m3h(curve: tuple[float, float, float], speed: float) -> float:
        lift_m = curve[0] * speed**2 - static_m
        return solve_m3h(lift_m, curve[1] * speed, curve[2] - friction) if lift_m > 0.0 else 0.0

    started_s = time.process_time()
    for flow_in_m3h in inflow_m3h.tolist():
        row, total_m3h = [flow_in_m3h * (1.0 + sensors.inflow_noise * rng.gauss(0.0, 1.0))], 0.0
        for curve, frequency_hz in zip(curves, frequencies_hz, strict=True):
            if frequency_hz <= 0.0:
                row += [0.0, 0.0, 0.0, 0.0]
                continue
            speed = frequency_hz / nominal_hz
            flow_m3h = duty_m3h(curve, speed)
            head_m = curve[0] * speed**2 + curve[1] * speed * flow_m3h + curve[2] * flow_m3h**2
            total_m3h += flow_m3h
            row += [
                frequency_hz,
                flow_m3h * (1.0 + sensors.flow_noise * rng.gauss(0.0, 1.0)),
                head_m * (1.0 + sensors.head_noise * rng.gauss(0.0, 1.0)),
                power_kw * speed * (1.0 + sensors.power_noise * rng.gauss(0.0, 1.0)),
            ]
        measured_m = level_m + sensors.level_noise_m * rng.gauss(0.0, 1.0)
        rows.append([measured_m, *row])
        level_m = max(level_m + (flow_in_m3h - total_m3h) / 3600.0 / station.sump.area_m2, 0.0)
        if len(running) < len(start_m) and measured_m >= start_m[len(running)]:
            turn = next(i % len(curves) for i in range(turn, turn + len(curves)) if i % len(curves) not in running)
            running.append(turn)
            turn += 1
        elif running and measured_m <= stop_m[len(running) - 1]:
            running.pop()
        for i, frequency_hz in enumerate(frequencies_hz):
            change_hz = rate_hz if i in running else -rate_hz
            frequencies_hz[i] = min(max(frequency_hz + change_hz, 0.0), nominal_hz)
    return time.process_time() - started_s


@contextlib.contextmanager
def output_to_errors() -> Iterator[None]:
    """Send what a library in C prints to standard error."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def swmm_s(station: Station, inflow_m3h: Floats, repeats: int, *, force_mains: bool) -> float | None:
    """Time of a day in EPA SWMM 5 by pyswmm's `execute`, routing step 1 s; None without pyswmm."""
    try:
        import pyswmm  # noqa: PLC0415 - not on every platform
    except ImportError:
        return None

    with tempfile.TemporaryDirectory() as folder, output_to_errors():
        path = Path(folder) / "station.inp"
        steps_m3h = inflow_m3h.reshape(-1, INFLOW_STEP_S).mean(axis=1).tolist()
        path.write_text(swmm_input(station, steps_m3h, initial_level_m=1.0, force_mains=force_mains))

        def run() -> None:
            with pyswmm.Simulation(str(path)) as simulation:
                simulation.execute()

        return least_s(run, repeats)


def figures(seed: int, repeats: int, processes: int, ensemble: int) -> dict[str, Any]:
    """All figures of one run."""
    from scipy.optimize import bisect  # noqa: PLC0415 - the start-up of other processes is measured without it

    station, scenario = find_station("alpha"), find_scenario("nominal")
    inflow_m3h = Simulation(station, scenario, seed).advance(DAY_S).truth["truth_inflow_m3h"]
    effects = tuple(EffectTable(**effect) for effect in SIX_EFFECTS)
    three_s = kernel_s(station, inflow_m3h, seed, repeats)
    kernels_s = {
        "1_pump": kernel_s(one_pump(station), inflow_m3h, seed, repeats),
        "3_pumps": three_s,
        "3_pumps_six_effects": kernel_s(station.model_copy(update={"effect": effects}), inflow_m3h, seed, repeats),
    }
    deviates_s = normals_s(station, seed, repeats)
    storm_m3h = np.full(DAY_S, STORM_M3H)
    python = {
        (way, name): (
            min(python_s(station, flows_m3h[:PYTHON_S], seed, solve_m3h) for _ in range(5)) * DAY_S / PYTHON_S,
            kernel,
        )
        for name, flows_m3h, kernel in (
            ("nominal", inflow_m3h, three_s),
            ("all_pumps_running", storm_m3h, kernel_s(station, storm_m3h, seed, repeats)),
        )
        for way, solve_m3h in (
            ("written_out", own_bisection_m3h),
            ("scipy_bisect", partial(scipy_bisection_m3h, bisect)),
        )
    }
    days_s = {truth: least_s(partial(day, station, seed, truth=truth), repeats) for truth in (True, False)}
    swmm = {
        name: swmm_s(station, inflow_m3h, 3, force_mains=force_mains)
        for name, force_mains in (("force_mains", True), ("without_mains", False))
    }
    return {
        "kernel_m_station_s_per_s": {name: _millions(DAY_S / kernel) for name, kernel in kernels_s.items()},
        "limit": {
            "kernel_ns": round(three_s / DAY_S * 1e9, 1),
            "of_which_normal_deviates_ns": round(deviates_s / DAY_S * 1e9, 1),
        },
        "end_to_end_m_station_s_per_s": {
            "with_truth": _millions(DAY_S / days_s[True]),
            "without_truth": _millions(DAY_S / days_s[False]),
        },
        "live_step_us": round(live_s(station, seed, repeats) * 1e6, 1),
        "live_fleet": in_fresh_process(partial(live_fleet, station, seed)),
        "ensemble_m_station_s_per_s": _millions(
            ensemble_rate(station, range(seed, seed + ensemble), processes),
        ),
        "start_up": start_up(),
        "memory_26_days_mb": {
            "with_truth": round(in_fresh_process(partial(kept_mb, truth=True))),
            "without_truth": round(in_fresh_process(partial(kept_mb, truth=False))),
        },
        "python_bisection": {
            f"{way}_{name}": {"station_s_per_s": round(DAY_S / run_s), "ratio_of_kernel": round(run_s / kernel)}
            for (way, name), (run_s, kernel) in python.items()
        },
        "swmm_execute": {
            name: {
                "station_s_per_s": round(DAY_S / run_s),
                "ratio_of_kernel": round(run_s / three_s),
                "ratio_end_to_end": round(run_s / days_s[True]),
            }
            if run_s
            else None
            for name, run_s in swmm.items()
        },
    }


def _millions(rate: float) -> float:
    return round(rate / 1e6, 2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=15, help="times that each figure is measured")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--ensemble", type=int, default=400, help="days in the ensemble, one seed each")
    arguments = parser.parse_args()
    about = {
        "benchmark": "simulator",
        "version": importlib.metadata.version("wetwell"),
        "python": platform.python_version(),
        "numba": numba.__version__,
        "machine": platform.machine(),
        "cores": os.cpu_count(),
        "processes": arguments.processes,
        "seeds": [arguments.seed, arguments.seed + arguments.ensemble - 1],
    }
    measured = figures(arguments.seed, arguments.repeats, arguments.processes, arguments.ensemble)
    print(json.dumps(about | measured, indent=2))


if __name__ == "__main__":
    main()
