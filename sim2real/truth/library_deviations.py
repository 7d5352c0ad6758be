"""A physical form of its own for each effect that the library holds.

A parameter that means what one of the library's effect of this name means has the same name and unit.
"""

import math
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.sim2real.truth.inflow import slow_noise
from wetwell.sim2real.truth.parts import Draw, Kind, Parameters, Truth, rounded
from wetwell.sim2real.truth.spec import BENCH, CONE, HOUR_S

DAY_S = 86_400.0
_UNITS = {"level_m": 0.05, "inflow_m3h": 0.1, "frequency_hz": 2.0, "flow_m3h": 0.06, "head_m": 0.05, "power_kw": 0.05}


def _chosen(values: Floats, pump: float, value: float) -> Floats:
    changed = values.copy()
    changed[slice(None) if pump < 1 else slice(int(pump) - 1, int(pump))] = value
    return changed


def _friction_bias(truth: Truth, p: Mapping[str, Any]) -> None:
    """Rough to smooth pipe: exponent of the loss between 2 and 1.75, the given factor at the duty flow."""
    truth.change(
        own_loss=truth.spec.own_loss * p["factor"],
        shared_loss=truth.spec.shared_loss * p["factor"],
        smoothness=p["smoothness"],
    )


def _static_head_bias(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.change(lift_m=truth.spec.lift_m + p["offset_m"])


def _level_dependent_static_head(truth: Truth, p: Mapping[str, Any]) -> None:
    """The lift counts from the outlet to the free surface, right at the reference level."""
    truth.change(lift_slope=p["slope"], lift_reference_m=p["reference_level_m"])


def _common_header(truth: Truth, p: Mapping[str, Any]) -> None:
    loss = truth.spec.own_loss
    truth.change(own_loss=(1.0 - p["shared_fraction"]) * loss, shared_loss=p["shared_fraction"] * loss)


def _water_inertia(truth: Truth, p: Mapping[str, Any]) -> None:
    if truth.station.mains[0].layout == "common":
        truth.change(shared_inertance=p["inertia_s2_m2"])
    else:
        truth.change(own_inertance=p["inertia_s2_m2"])


def _air_pocket(truth: Truth, p: Mapping[str, Any]) -> None:
    """Logistic growth from a seed; carried out by the volume pumped."""
    truth.change(
        air_limit_m=p["head_m"], air_seed_m=0.03 * p["head_m"], air_rate=1.0 / p["rate_s"], air_purge_m3=p["purge_m3"]
    )


def _sump_area_profile(truth: Truth, p: Mapping[str, Any]) -> None:
    """Frustum of a cone, or a bench with a rounded edge."""
    if "bench_m" in p:
        truth.change(shape=float(BENCH), floor_factor=p["bench_factor"], shape_height_m=p["bench_m"])
    else:
        truth.change(shape=float(CONE), floor_factor=p["bottom_factor"], shape_height_m=p["height_m"])


def _unmetered_inflow(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.change(hidden_inflow=p["flow_m3h"] / HOUR_S)


def _pump_wear(truth: Truth, p: Mapping[str, Any]) -> None:
    """Worn vanes lower the whole curve; a worn ring lets water run back, by the root of the head."""
    spec = truth.spec
    if "head_loss" in p:
        truth.change(head_factor=_chosen(spec.head_factor, p["pump"], 1.0 - p["head_loss"]))
    else:
        truth.change(
            ring_leak=_chosen(spec.ring_leak, p["pump"], p["ring_m3h"] / HOUR_S / math.sqrt(p["duty_head_m"]))
        )


def _ragging(truth: Truth, p: Mapping[str, Any]) -> None:
    """Rags come with the water: loss limit V / (V + V½) of the volume V pumped since the start."""
    spec = truth.spec
    half_m3 = p["half_s"] * spec.rated_flow
    truth.change(
        rag_limit=_chosen(spec.rag_limit, p["pump"], p["rag_limit"]),
        rag_half_m3=_chosen(spec.rag_half_m3, p["pump"], half_m3),
    )


def _check_valve_leak(truth: Truth, p: Mapping[str, Any]) -> None:
    """A gap under each flap, an orifice under the head of the main."""
    truth.change(flap_leak=p["leak_m3h"] / HOUR_S)


def _sticking_check_valve(truth: Truth, p: Mapping[str, Any]) -> None:
    """The flap stays shut until the pump exceeds the main's head by a good deal; then it swings open."""
    truth.change(flap_opening_m=_chosen(truth.spec.flap_opening_m, p["pump"], p["opening_m"]))


def _motor_slip(truth: Truth, p: Mapping[str, Any]) -> None:
    """Slip by torque, a little more than in proportion, as towards breakdown."""
    truth.change(slip=p["slip"])


def _ramp_shape(truth: Truth, p: Mapping[str, Any]) -> None:
    """S-ramp (half cosine) or parabola in the drive."""
    truth.change(ramp_bow=p["bow"] if "bow" in p else -p["parabola"])


def _load_dependent_power(truth: Truth, p: Mapping[str, Any]) -> None:
    """Torque parabola times speed, copper loss by the square of the torque, iron loss."""
    truth.change(load_share=p["share"], rated_factor=p["load_factor"])


def _supply_voltage_variation(truth: Truth, p: Mapping[str, Any]) -> None:
    time_s = truth.time_s
    daily = np.sin(2.0 * np.pi * (time_s / DAY_S - p["phase"]))
    fast = slow_noise(time_s.size, p["fast_s"], truth.rng)
    truth.around.voltage_factor[:] *= 1.0 + p["daily_amplitude"] * daily + p["fast_spread"] * fast


def _control_delay(truth: Truth, p: Mapping[str, Any]) -> None:
    """On- and off-delay timers: the level must have been past the threshold for so long."""
    truth.change(timer_s=p["delay_s"])


def _threshold_shift(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.change(start_m=truth.spec.start_m + p["start_m"], stop_m=truth.spec.stop_m + p["stop_m"])


def _level_sensor_lag(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.change(level_lag_s=p["lag_s"])


def _level_quantisation(truth: Truth, p: Mapping[str, Any]) -> None:
    """Counts of a converter, which cuts off."""
    truth.telemetry.of("level_m").count = p["quantum_m"]


def _flow_meter_gain(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.telemetry.of("flow_m3h").gain = p["factor"]


def _power_meter_gain(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.telemetry.of("power_kw").gain = p["factor"]


def _flow_meter_lag(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.change(flow_lag_s=p["lag_s"])


def _flow_low_cutoff(truth: Truth, p: Mapping[str, Any]) -> None:
    """With 5 % of hysteresis."""
    truth.telemetry.of("flow_m3h").cutoff = p["cutoff_m3h"]


def _head_sensor_offset(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.telemetry.of("head_m").offset = p["offset_m"]


def _channel_delay(truth: Truth, p: Mapping[str, Any]) -> None:
    truth.telemetry.of(p["channel"]).delay_s = p["delay_s"]


def _report_by_exception(truth: Truth, p: Mapping[str, Any]) -> None:
    """With a report after a time in any case."""
    channel = truth.telemetry.of(p["channel"])
    channel.deadband, channel.report_s = p["deadband"], p["report_s"]


def _wear(d: Draw) -> Parameters:
    if d.rng.random() < 0.6:
        return {"head_loss": d.over(0.03, 0.2), "pump": d.pump}
    return {"ring_m3h": d.over(0.04, 0.2) * d.flow_m3h, "duty_head_m": d.head_m, "pump": d.pump}


def _ramp(d: Draw) -> Parameters:
    bow, parabola = d.between(0.6, 1.0), d.between(0.4, 0.9)
    return {"bow": bow} if d.either(1.0, -1.0) > 0.0 else {"parabola": parabola}


def _shift(d: Draw) -> Parameters:
    size = d.over(0.03, 0.25) * d.depth_m
    parts = d.rng.integers(3)
    start_m = d.either(size, -size) if parts != 1 else 0.0
    stop_m = d.either(size, -size) if parts != 0 else 0.0
    lowest = 0.15 - d.station.control.stop_levels_m[0]
    return {"start_m": rounded(start_m), "stop_m": rounded(max(stop_m, lowest))}


def _late_channel(d: Draw) -> Parameters:
    quantities: tuple[AnalogueQuantity, ...] = ("level_m", "frequency_hz", "flow_m3h", "head_m", "power_kw")
    return {"channel": str(d.rng.choice(quantities)), "delay_s": d.over(3.0, 25.0)}


def _reported(d: Draw) -> Parameters:
    quantity = cast("AnalogueQuantity", str(d.rng.choice(("level_m", "flow_m3h", "head_m", "power_kw"))))
    electrical = d.station.electrical
    rated_kw = math.sqrt(3.0) * electrical.voltage_v * electrical.rated_current_a * electrical.power_factor / 1000.0
    scale = {"flow_m3h": d.flow_m3h, "head_m": d.head_m, "power_kw": rated_kw}.get(quantity, 1.0)
    return {
        "channel": quantity,
        "deadband": rounded(d.over(0.7, 2.5) * _UNITS[quantity] * scale),
        "report_s": d.over(300.0, 1800.0),
    }


def _area(d: Draw) -> Parameters:
    stop_m = d.station.control.stop_levels_m[0]
    if d.rng.random() < 0.5:
        height_m = rounded(stop_m + d.between(0.5, 0.95) * d.depth_m)
        return {"bottom_factor": d.between(0.3, 0.65), "height_m": height_m}
    return {"bench_factor": d.between(0.3, 0.65), "bench_m": rounded(stop_m + d.between(0.25, 0.6) * d.depth_m)}


LIBRARY_KINDS: dict[str, Kind] = {
    "friction_bias": Kind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {"factor": d.either(d.over(1.08, 1.8), d.over(0.5, 0.92)), "smoothness": d.between(0.0, 0.6)},
        _friction_bias,
    ),
    "static_head_bias": Kind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {
            "offset_m": rounded(
                d.head_m * d.over(0.03, 0.2)
                if d.rng.random() < 0.7
                else -0.8 * min(d.head_m * d.over(0.03, 0.2), d.station.mains[0].lift_at_zero_m)
            )
        },
        _static_head_bias,
    ),
    "level_dependent_static_head": Kind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {
            "slope": d.between(0.8, 1.3),
            "reference_level_m": d.between(0.0, 2.0 * d.station.control.start_levels_m[0]),
        },
        _level_dependent_static_head,
    ),
    "common_header": Kind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {"shared_fraction": d.between(0.6, 1.0)},
        _common_header,
        needs_two_pumps=True,
    ),
    "water_inertia": Kind(
        "rising_main",
        ("flow_m3h", "head_m"),
        lambda d: {"inertia_s2_m2": rounded(d.over(3.0, 15.0) * d.head_m / (d.flow_m3h / HOUR_S))},
        _water_inertia,
    ),
    "air_pocket": Kind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {
            "head_m": rounded(d.head_m * d.over(0.05, 0.25)),
            "rate_s": d.over(30.0, 120.0),
            "purge_m3": rounded(d.over(40.0, 150.0) * d.flow_m3h / HOUR_S),
        },
        _air_pocket,
    ),
    "sump_area_profile": Kind("sump", ("level_m",), _area, _sump_area_profile),
    "unmetered_inflow": Kind(
        "sump",
        ("level_m",),
        lambda d: {"flow_m3h": rounded(d.flow_m3h * d.over(0.03, 0.2))},
        _unmetered_inflow,
        is_behind_meter=True,
    ),
    "pump_wear": Kind("pump", ("flow_m3h", "head_m", "level_m"), _wear, _pump_wear),
    "ragging": Kind(
        "pump",
        ("flow_m3h", "head_m"),
        lambda d: {"rag_limit": d.over(0.03, 0.2), "half_s": d.over(60.0, 240.0), "pump": d.pump},
        _ragging,
    ),
    "check_valve_leak": Kind(
        "pump",
        ("level_m",),
        lambda d: {
            "leak_m3h": rounded(
                d.flow_m3h * d.over(0.03, 0.1) / math.sqrt(max(d.station.mains[0].lift_at_zero_m, 0.5))
            )
        },
        _check_valve_leak,
    ),
    "sticking_check_valve": Kind(
        "pump",
        ("flow_m3h", "head_m"),
        lambda d: {
            "opening_m": rounded(
                d.over(0.2, 0.7) * (d.station.pump[0].coefficients[0] - d.station.mains[0].lift_at_zero_m)
            ),
            "pump": d.pump,
        },
        _sticking_check_valve,
    ),
    "motor_slip": Kind(
        "drive", ("flow_m3h", "head_m", "level_m"), lambda d: {"slip": d.over(0.02, 0.09)}, _motor_slip
    ),
    "ramp_shape": Kind(
        "drive",
        ("flow_m3h", "head_m"),
        _ramp,
        _ramp_shape,
    ),
    "load_dependent_power": Kind(
        "drive",
        ("power_kw",),
        lambda d: {"share": d.between(0.6, 1.0), "load_factor": d.between(0.75, 1.1)},
        _load_dependent_power,
    ),
    "supply_voltage_variation": Kind(
        "drive",
        ("power_kw",),
        lambda d: {
            "daily_amplitude": d.over(0.015, 0.06),
            "phase": d.between(0.0, 1.0),
            "fast_spread": d.over(0.004, 0.02),
            "fast_s": d.over(60.0, 600.0),
        },
        _supply_voltage_variation,
    ),
    "control_delay": Kind(
        "controller", ("level_m",), lambda d: {"delay_s": float(d.rng.integers(5, 31))}, _control_delay
    ),
    "threshold_shift": Kind("controller", ("level_m",), _shift, _threshold_shift),
    "level_sensor_lag": Kind("level_sensor", ("level_m",), lambda d: {"lag_s": d.over(6.0, 40.0)}, _level_sensor_lag),
    "level_quantisation": Kind(
        "level_sensor", ("level_m",), lambda d: {"quantum_m": d.over(0.01, 0.08)}, _level_quantisation
    ),
    "flow_meter_gain": Kind(
        "flow_meter",
        ("flow_m3h",),
        lambda d: {"factor": d.either(d.between(1.03, 1.15), d.between(0.85, 0.97))},
        _flow_meter_gain,
    ),
    "power_meter_gain": Kind(
        "power_meter",
        ("power_kw",),
        lambda d: {"factor": d.either(d.between(1.03, 1.2), d.between(0.8, 0.97))},
        _power_meter_gain,
    ),
    "flow_meter_lag": Kind("flow_meter", ("flow_m3h",), lambda d: {"lag_s": d.over(3.0, 20.0)}, _flow_meter_lag),
    "flow_low_cutoff": Kind(
        "flow_meter",
        ("flow_m3h",),
        lambda d: {"cutoff_m3h": rounded(d.flow_m3h * d.between(0.2, 0.6))},
        _flow_low_cutoff,
    ),
    "head_sensor_offset": Kind(
        "head_sensor",
        ("head_m",),
        lambda d: {"offset_m": rounded(d.head_m * d.either(d.over(0.03, 0.12), -d.over(0.03, 0.12)))},
        _head_sensor_offset,
    ),
    "channel_delay": Kind("telemetry", (), _late_channel, _channel_delay),
    "report_by_exception": Kind("telemetry", (), _reported, _report_by_exception),
}
