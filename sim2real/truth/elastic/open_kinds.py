"""Deviations of the elastic plant that the library of effects does not hold, most of them of no other plant."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wetwell.sim2real.truth.elastic.kind import ElasticKind, ElasticTruth, digits
from wetwell.sim2real.truth.elastic.weather import DAY_S, wandering

Given = Mapping[str, Any]
TIDE_S = 44_714.0
"""Principal lunar tide. [s]"""


def _outlet_tide(truth: ElasticTruth, p: Given) -> None:
    """The outfall lies in tidal water."""
    truth.weather.lift_m[:] += p["range_m"] * (1.0 + np.sin(2.0 * np.pi * (truth.time_s / TIDE_S - p["phase"])))


def _shared_main(truth: ElasticTruth, p: Given) -> None:
    """Another station pumps into the same main, in bursts of its own."""
    raised = np.zeros(truth.time_s.size)
    now_s = truth.rng.exponential(p["pause_s"])
    while now_s < raised.size:
        until_s = now_s + truth.rng.uniform(0.6, 1.4) * p["burst_s"]
        raised[int(now_s) : int(until_s)] = p["head_m"]
        now_s = until_s + truth.rng.exponential(p["pause_s"])
    truth.weather.lift_m[:] += np.convolve(raised, np.full(9, 1.0 / 9.0), mode="same")


def _pipe_scouring(truth: ElasticTruth, p: Given) -> None:
    """Slime grows on the wall for days; a storm takes it off at once, and it begins anew."""
    since_s = (truth.time_s - p["scoured"] * truth.time_s.size) % truth.time_s.size
    truth.weather.loss[:] *= 1.0 + p["growth"] * (1.0 - np.exp(-since_s / p["growth_s"]))


def _electrode_fouling(truth: ElasticTruth, p: Given) -> None:
    """Grease on the electrodes: what the meter reads falls for hours, until it is rinsed."""
    turn = (truth.time_s / truth.time_s.size * p["rinses"] + p["phase"]) % 1.0
    truth.instruments.of("flow_m3h").factor = 1.0 - p["loss"] * turn**0.7


def _cavitation(truth: ElasticTruth, p: Given) -> None:
    """Too little water over the inlet: the pump loses head with the square of flow and of what is missing."""
    truth.change(suction_m=p["suction_m"], suction_level_m=p["needed_level_m"])


def _warming_power_meter(truth: ElasticTruth, p: Given) -> None:
    """The zero of the transducer follows the temperature of its room, up in the afternoon, and creeps."""
    warmth = np.sin(2.0 * np.pi * (truth.time_s / DAY_S - p["phase"])) + truth.time_s / truth.time_s.size
    truth.instruments.of("power_kw").shift = p["zero_kw"] * warmth


def _wandering_head_zero(truth: ElasticTruth, p: Given) -> None:
    """Fat in the impulse line: the head is off by what wanders for an hour or so."""
    truth.instruments.of("head_m").shift = p["wander_m"] * wandering(truth.time_s.size, p["wander_s"], truth.rng)


def _second_echo(truth: ElasticTruth, p: Given) -> None:
    """Now and then an ultrasonic sensor takes the echo of a ladder for the water; the controller believes it."""
    error = truth.weather.reading_error_m
    now_s = truth.rng.exponential(p["apart_s"])
    while now_s < error.size:
        until_s = now_s + truth.rng.uniform(0.5, 1.5) * p["lasting_s"]
        error[int(now_s) : int(until_s)] += p["echo_m"]
        now_s = until_s + truth.rng.exponential(p["apart_s"])


def _storm_tank(truth: ElasticTruth, p: Given) -> None:
    """Behind the meter a weir turns strong inflow into a tank, which a small pump empties when there is less."""
    inflow = truth.weather.inflow
    weir, pump = p["weir_share"] * inflow.mean(), p["pump_share"] * inflow.mean()
    volume_m3, changed = 0.0, inflow.tolist()
    for second, arriving in enumerate(changed):
        given = max(arriving - weir, 0.0) if arriving > weir else -min(pump, volume_m3)
        volume_m3 += given
        changed[second] = arriving - given
    inflow[:] = changed


def _skipping_clock(truth: ElasticTruth, p: Given) -> None:
    """A logger of one channel is set right now and then, and runs late in between."""
    truth.instruments.of(p["channel"]).delay_s = p["late_s"] * ((truth.time_s / p["set_s"]) % 1.0)


def _beating_drive(truth: ElasticTruth, p: Given) -> None:
    """The speed controller of the drive hunts."""
    truth.change(hunting=p["beat"], hunting_s=p["beat_s"])


OPEN_FORMS: dict[str, ElasticKind] = {
    "outlet_tide": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m"),
        lambda d: {"range_m": digits(d.head_m * d.size(0.04, 0.12)), "phase": d.even(0.0, 1.0)},
        _outlet_tide,
    ),
    "shared_main": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m"),
        lambda d: {
            "head_m": digits(d.head_m * d.size(0.06, 0.2)),
            "burst_s": d.size(120.0, 600.0),
            "pause_s": d.size(300.0, 1800.0),
        },
        _shared_main,
    ),
    "pipe_scouring": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m"),
        lambda d: {"growth": d.size(0.4, 1.0), "growth_s": d.size(7200.0, 28_800.0), "scoured": d.even(0.3, 0.7)},
        _pipe_scouring,
    ),
    "electrode_fouling": ElasticKind(
        "flow_meter",
        ("flow_m3h",),
        lambda d: {"loss": d.size(0.08, 0.25), "rinses": d.even(1.0, 3.0), "phase": d.even(0.0, 1.0)},
        _electrode_fouling,
    ),
    "cavitation": ElasticKind(
        "pump",
        ("flow_m3h", "head_m"),
        lambda d: {
            "suction_m": digits(d.head_m * d.size(0.4, 1.2)),
            "needed_level_m": digits(d.station.control.stop_levels_m[0] + d.even(0.4, 0.8) * d.depth_m),
        },
        _cavitation,
    ),
    "warming_power_meter": ElasticKind(
        "power_meter",
        ("power_kw",),
        lambda d: {"zero_kw": digits(d.sign() * d.power_kw * d.size(0.06, 0.2)), "phase": d.even(0.0, 1.0)},
        _warming_power_meter,
    ),
    "wandering_head_zero": ElasticKind(
        "head_sensor",
        ("head_m",),
        lambda d: {"wander_m": digits(d.head_m * d.size(0.04, 0.12)), "wander_s": d.size(1800.0, 7200.0)},
        _wandering_head_zero,
    ),
    "second_echo": ElasticKind(
        "level_sensor",
        ("level_m",),
        lambda d: {
            "echo_m": digits(d.sign() * d.depth_m * d.size(0.08, 0.25)),
            "lasting_s": d.size(20.0, 120.0),
            "apart_s": d.size(600.0, 3600.0),
        },
        _second_echo,
    ),
    "storm_tank": ElasticKind(
        "sump",
        ("level_m",),
        lambda d: {"weir_share": d.even(0.7, 1.0), "pump_share": d.even(0.15, 0.4)},
        _storm_tank,
        is_behind_meter=True,
    ),
    "skipping_clock": ElasticKind(
        "telemetry",
        (),
        lambda d: {
            "channel": d.one_of("level_m", "flow_m3h", "head_m"),
            "late_s": d.size(15.0, 60.0),
            "set_s": d.size(10_800.0, 43_200.0),
        },
        _skipping_clock,
    ),
    "beating_drive": ElasticKind(
        "drive",
        ("flow_m3h", "head_m"),
        lambda d: {"beat": d.size(0.015, 0.05), "beat_s": d.size(15.0, 90.0)},
        _beating_drive,
    ),
}
