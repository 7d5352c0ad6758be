"""Families of deviations that the library of effects does not hold: the right answer is that none explains them."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.signal import lfilter

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.truth.inflow import slow_noise
from wetwell.sim2real.truth.parts import Kind, Truth, rounded

DAY_S = 86_400.0


def _flow_meter_drift(truth: Truth, p: Mapping[str, Any]) -> None:
    """The gain of the flow meter runs away and partly comes back: deposits on the electrodes."""
    turn = truth.time_s / truth.time_s.size
    truth.telemetry.of("flow_m3h").gain = 1.0 + p["drift"] * np.sin(p["turns"] * np.pi * turn)


def _friction_daily_cycle(truth: Truth, p: Mapping[str, Any]) -> None:
    """Grease stiffens at night."""
    cycle = np.cos(2.0 * np.pi * (truth.time_s / DAY_S - p["phase"]))
    truth.around.loss_factor[:] *= 1.0 + p["swing"] * (1.0 + cycle)


def _breaking_siphon(truth: Truth, p: Mapping[str, Any]) -> None:
    """Behind a high point the pipe runs full after a while and pulls; it breaks as soon as the flow is low."""
    truth.change(
        siphon_m=p["siphon_m"], siphon_flow=p["flow_share"] * truth.spec.rated_flow, siphon_prime_s=p["prime_s"]
    )


def _head_sensor_scale(truth: Truth, p: Mapping[str, Any]) -> None:
    """A bent scale, and a zero that goes with the temperature of the day."""
    channel = truth.telemetry.of("head_m")
    channel.bend = p["bend_per_m"]
    channel.offset = p["swing_m"] * np.sin(2.0 * np.pi * truth.time_s / DAY_S)


def _second_sump(truth: Truth, p: Mapping[str, Any]) -> None:
    """A share of the metered inflow comes through a tank behind the meter, a first-order delay later."""
    inflow = truth.around.inflow
    share = math.exp(-1.0 / p["tank_s"])
    late = slow_response(inflow, share)
    inflow[:] += p["share"] * (late - inflow)


def _clock_drift(truth: Truth, p: Mapping[str, Any]) -> None:
    """The logger of one channel loses time."""
    truth.telemetry.of(p["channel"]).delay_s = p["drift_s"] * truth.time_s / truth.time_s.size


def _power_meter_drift(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.telemetry.of("power_kw").gain = 1.0 + p["drift"] * truth.time_s / truth.time_s.size


def _foam(truth: Truth, p: Mapping[str, Any]) -> None:
    """Foam makes an ultrasonic sensor read high now and then, for the controller too."""
    wandering = slow_noise(truth.time_s.size, p["foam_s"], truth.rng)
    truth.around.level_error_m[:] += p["foam_m"] * np.clip(wandering, 0.0, 1.0)


def _inlet_vortex(truth: Truth, p: Mapping[str, Any]) -> None:
    """Air drawn in at low level costs head, by the square of what is missing of the submergence."""
    truth.change(vortex_m=p["vortex_m"], vortex_level_m=p["submergence_m"])


def _speed_hunting(truth: Truth, p: Mapping[str, Any]) -> None:
    """The drive's speed swings about its command."""
    truth.change(hunting=p["swing"], hunting_s=p["period_s"])


def slow_response(values: Floats, share: float) -> Floats:
    """(n,) first-order response that keeps a share of itself at each step, at rest at the first value.

    Examples
    --------
    >>> slow_response(np.array([0.0, 1.0, 1.0]), 0.5)
    array([0.  , 0.5 , 0.75])
    """
    response, _ = lfilter([1.0 - share], [1.0, -share], values, zi=[share * values[0]])
    return np.asarray(response)


OPEN_KINDS: dict[str, Kind] = {
    "flow_meter_drift": Kind(
        "flow_meter",
        ("flow_m3h",),
        lambda d: {"drift": d.either(d.between(0.08, 0.2), -d.between(0.08, 0.2)), "turns": d.between(1.0, 4.0)},
        _flow_meter_drift,
    ),
    "friction_daily_cycle": Kind(
        "rising_main",
        ("flow_m3h", "head_m"),
        lambda d: {"swing": d.over(0.2, 0.5), "phase": d.between(0.0, 1.0)},
        _friction_daily_cycle,
    ),
    "breaking_siphon": Kind(
        "rising_main",
        ("flow_m3h", "head_m"),
        lambda d: {
            "siphon_m": rounded(d.between(0.5, 0.9) * d.station.mains[0].lift_at_zero_m),
            "flow_share": d.between(0.5, 0.75),
            "prime_s": d.over(20.0, 80.0),
        },
        _breaking_siphon,
    ),
    "head_sensor_scale": Kind(
        "head_sensor",
        ("head_m",),
        lambda d: {
            "bend_per_m": rounded(d.either(1.0, -1.0) * d.between(0.05, 0.12) / d.head_m),
            "swing_m": rounded(d.between(0.05, 0.1) * d.head_m),
        },
        _head_sensor_scale,
    ),
    "second_sump": Kind(
        "sump",
        ("level_m",),
        lambda d: {"share": d.between(0.5, 0.9), "tank_s": d.over(900.0, 3600.0)},
        _second_sump,
        is_behind_meter=True,
    ),
    "clock_drift": Kind(
        "telemetry",
        (),
        lambda d: {"channel": str(d.rng.choice(("level_m", "flow_m3h", "head_m"))), "drift_s": d.between(20.0, 60.0)},
        _clock_drift,
    ),
    "power_meter_drift": Kind(
        "power_meter",
        ("power_kw",),
        lambda d: {"drift": d.either(d.between(0.08, 0.2), -d.between(0.08, 0.2))},
        _power_meter_drift,
    ),
    "foam": Kind(
        "level_sensor",
        ("level_m",),
        lambda d: {"foam_m": rounded(d.between(0.08, 0.2) * d.depth_m), "foam_s": d.over(120.0, 900.0)},
        _foam,
    ),
    "inlet_vortex": Kind(
        "pump",
        ("flow_m3h", "head_m"),
        lambda d: {
            "vortex_m": rounded(d.between(0.5, 1.0) * d.head_m),
            "submergence_m": rounded(d.station.control.stop_levels_m[0] + d.between(0.4, 0.8) * d.depth_m),
        },
        _inlet_vortex,
    ),
    "speed_hunting": Kind(
        "drive",
        ("flow_m3h", "head_m"),
        lambda d: {"swing": d.between(0.02, 0.05), "period_s": d.between(20.0, 90.0)},
        _speed_hunting,
    ),
}
