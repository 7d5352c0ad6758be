"""Records of an inlet station with two mains, two sizes of pumps and no meter of head: solved here a second time."""

import math

import numpy as np
from scipy.optimize import brentq

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S

SMALL, LARGE = (41.0, -1.0e-4, -3.3e-6), (43.0, -4.0e-4, -8.8e-7)
DATASHEETS = (SMALL, LARGE, LARGE, SMALL, LARGE, LARGE)
MAIN_OF_PUMP = (0, 0, 0, 1, 1, 1)
DELIVERY_LEVEL_M = 30.0
FRICTION_H2_M5 = 3.0e-8
POWER_POINTS = {SMALL: ((1300.0, 165.0), (2100.0, 186.0)), LARGE: ((2000.0, 297.0), (4000.0, 345.0))}
EFFICIENCY = 0.94 * 0.97


def station() -> Station:
    """What the file says."""
    return Station.model_validate(
        {
            "name": "inlet",
            "sump": {"volume_points": [[0.0, 100.0], [2.0, 7000.0], [6.0, 80_000.0]]},
            "control": {"mode": "external"},
            "electrical": {"power_model": "load", "motor_efficiency": 0.94, "drive_efficiency": 0.97},
            "main": [
                {
                    "name": name,
                    "delivery_level_m": DELIVERY_LEVEL_M,
                    "friction_h2_m5": FRICTION_H2_M5,
                    "layout": "common",
                }
                for name in ("line 1", "line 2")
            ],
            "pump": [
                {"main": f"line {main + 1}", "curve": curve, "power_points": POWER_POINTS[curve]}
                for main, curve in zip(MAIN_OF_PUMP, DATASHEETS, strict=True)
            ],
        }
    )


def truth(rng):
    """Scales of head and flow of each pump 5 to 15 % off, friction and level of delivery of each main off."""
    sign = rng.choice([-1.0, 1.0], (3, 6))
    off = sign * rng.uniform(0.05, 0.15, (3, 6))
    return {
        "head_scale": 1.0 + off[0],
        "flow_scale": 1.0 + off[1],
        "power_scale": 1.0 + off[2],
        "friction_h2_m5": FRICTION_H2_M5 * rng.uniform(0.5, 1.5, 2),
        "delivery_level_m": DELIVERY_LEVEL_M + rng.uniform(-0.8, 0.8, 2),
    }


def duty_flows_m3h(curves, speed, lift_m, friction_h2_m5):
    """Flows of pumps on one header by root finding on the head of the header."""
    if not np.any(speed > 0.0):
        return np.zeros(speed.size)

    def flow(curve, ratio, head_m):
        c0, c1, c2 = curve
        if ratio <= 0.0 or c0 * ratio**2 <= head_m:
            return 0.0
        slope = c1 * ratio
        return (slope + math.sqrt(slope**2 - 4.0 * c2 * (c0 * ratio**2 - head_m))) / (-2.0 * c2)

    def flows(head_m):
        return np.array([flow(curve, ratio, head_m) for curve, ratio in zip(curves, speed, strict=True)])

    highest_m = max(curve[0] * ratio**2 for curve, ratio in zip(curves, speed, strict=True))
    if highest_m <= lift_m:
        return np.zeros(speed.size)
    head_m = brentq(lambda h: lift_m + friction_h2_m5 * flows(h).sum() ** 2 - h, lift_m, highest_m)
    return flows(head_m)


def recording(rng, real, days=14.0, step_s=900, run_sd=0.01, noise=0.003, clogged=0.0):
    """Means of `step_s` in which pumps run at drawn speeds for hours; a share of the runs is `clogged` by 30 %."""
    rows = int(days * 86_400 / step_s)
    level_m = 2.5 + 1.5 * np.sin(np.arange(rows) / rows * 9.0) + rng.normal(0.0, 0.05, rows).cumsum() * 0.05
    speed, run = np.zeros((6, rows)), np.zeros((6, rows), dtype=int)
    for i in range(6):
        row, number = int(rng.integers(0, 20)), 0
        while row < rows:
            length = int(rng.integers(3 * 3600, 9 * 3600)) // step_s
            number += 1
            speed[i, row : row + length] = rng.uniform(0.9, 1.0)
            run[i, row : row + length] = number
            row += length + int(rng.integers(2 * 3600, 8 * 3600)) // step_s
    flow_m3h = np.zeros((6, rows))
    curves = [
        (a * c0, a * c1 / b, a * c2 / b**2)
        for (c0, c1, c2), a, b in zip(DATASHEETS, real["head_scale"], real["flow_scale"], strict=True)
    ]
    for main in range(2):
        members = [i for i in range(6) if MAIN_OF_PUMP[i] == main]
        for row in range(rows):
            lift_m = real["delivery_level_m"][main] - level_m[row]
            flow_m3h[members, row] = duty_flows_m3h(
                [curves[i] for i in members], speed[members, row], lift_m, real["friction_h2_m5"][main]
            )
    power_kw = np.zeros_like(flow_m3h)
    for i, curve in enumerate(DATASHEETS):
        on = flow_m3h[i] > 0.0
        (low_m3h, low_kw), (high_m3h, high_kw) = POWER_POINTS[curve]
        ratio = np.where(on, speed[i], 1.0)
        middle_m = DELIVERY_LEVEL_M - 3.0
        rated_m3h = float(duty_flows_m3h([curve], np.ones(1), middle_m, FRICTION_H2_M5)[0])
        standing_kw = 0.02 * (low_kw + (high_kw - low_kw) * (rated_m3h - low_m3h) / (high_m3h - low_m3h))
        line_kw = low_kw + (high_kw - low_kw) * (flow_m3h[i] / ratio - low_m3h) / (high_m3h - low_m3h)
        power_kw[i] = on * real["power_scale"][i] * (ratio**3 * line_kw + standing_kw) / (1.02 * EFFICIENCY)
    columns = {"level_m": level_m}
    for i in range(6):
        own = rng.normal(0.0, run_sd, run[i].max() + 1) - 0.3 * (rng.random(run[i].max() + 1) < clogged)
        measured = flow_m3h[i] * (1.0 + own[run[i]] + rng.normal(0.0, noise, rows))
        columns |= {
            f"pump{i + 1}_frequency_hz": 50.0 * speed[i],
            f"pump{i + 1}_flow_m3h": measured,
            f"pump{i + 1}_power_kw": power_kw[i] * (1.0 + rng.normal(0.0, noise, rows)),
        }
    return Recording(time_ns=np.arange(1, rows + 1) * step_s * NS_PER_S, columns=columns, value="mean")
