"""A form of its own, after other causes, for each effect that the library holds.

A parameter has the library's name and unit only where it means the same.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from wetwell.sim2real.truth.elastic.kind import ElasticKind, ElasticTruth, Parameters, Sizes, digits
from wetwell.sim2real.truth.elastic.pipe import pipe_of
from wetwell.sim2real.truth.elastic.spec import EARLY, FILLET, HOUR_S, SMOOTH, WEDGE, with_pipe, with_slip
from wetwell.sim2real.truth.elastic.weather import DAY_S, wandering

Given = Mapping[str, Any]


def _friction_bias(truth: ElasticTruth, p: Given) -> None:
    """Deposits or a smooth lining: a factor at the duty, of which a share follows Colebrook's law."""
    truth.change(loss=truth.spec.loss * p["factor"], darcy_share=max(truth.spec.darcy_share, p["wall_share"]))


def _static_head_bias(truth: ElasticTruth, p: Given) -> None:
    """The outlet lies higher, or lower, than the drawing says."""
    truth.change(lift_m=truth.spec.lift_m + p["offset_m"])


def _level_dependent_static_head(truth: ElasticTruth, p: Given) -> None:
    """The outlet is an elevation: the lift counts from the water, and is the file's at one level only."""
    truth.change(lift_slope=1.0, lift_reference_m=p["reference_level_m"])


def _common_header(truth: ElasticTruth, p: Given) -> None:
    """The pumps share one elastic main; what is left of each pump's own pipe is short and stiff."""
    spec, share = truth.spec, p["shared_fraction"]
    truth.change(
        main_of=np.zeros_like(spec.main_of),
        reaches=spec.reaches[:1],
        impedance=spec.impedance[:1],
        loss=share * spec.loss[:1],
        branch_loss=(1.0 - share) * float(spec.loss[0]),
    )


def _water_inertia(truth: ElasticTruth, p: Given) -> None:
    """A long main, in which waves run to and fro."""
    spec, machinery = truth.spec, truth.machinery
    pipe = pipe_of(
        float(spec.rated_flow[0]),
        float(spec.loss[0]),
        velocity_m_s=machinery.velocity_m_s,
        wave_m_s=machinery.wave_m_s,
        column_s2_m2=p["column_s2_m2"],
        roughness_mm=machinery.roughness_mm,
    )
    truth.spec = with_pipe(spec, pipe)


def _air_pocket(truth: ElasticTruth, p: Given) -> None:
    """Gas gathers evenly until the crest is full, and leaves with the water."""
    truth.change(
        air_limit_m=p["head_m"], air_growth_s=p["fills_s"], air_clearing_m3=p["cleared_s"] * truth.spec.rated_flow[0]
    )


def _sump_area_profile(truth: ElasticTruth, p: Given) -> None:
    """A floor rounded to the walls, or a wedge."""
    form = FILLET if p["form"] == "fillet" else WEDGE
    truth.change(floor=form, floor_share=p["floor_share"], floor_height_m=p["floor_height_m"])


def _unmetered_inflow(truth: ElasticTruth, p: Given) -> None:
    """Groundwater, which breathes a little with the day."""
    truth.change(seepage=p["flow_m3h"] / HOUR_S, seepage_swing=p["breath"])


def _pump_wear(truth: ElasticTruth, p: Given) -> None:
    """Blunt vanes lose head in part with the square of the flow; a wide ring lets water back."""
    spec = truth.spec
    leak = p["ring_share"] * float(spec.rated_flow[0]) / math.sqrt(float(spec.rated_head_m[0]))
    truth.change(
        vane_loss=truth.of_pump(spec.vane_loss, p["pump"], p["vane_share"]),
        ring_leak=truth.of_pump(spec.ring_leak, p["pump"], leak),
    )


def _ragging(truth: ElasticTruth, p: Given) -> None:
    """Rags narrow the inlet evenly with time, until as many hang there as can; a throttle, shed at the stop."""
    spec = truth.spec
    limit_m = p["throttle_share"] * float(spec.rated_head_m[0])
    truth.change(
        rag_limit_m=truth.of_pump(spec.rag_limit_m, p["pump"], limit_m),
        rag_s=truth.of_pump(spec.rag_s, p["pump"], p["gathered_s"]),
    )


def _check_valve_leak(truth: ElasticTruth, p: Given) -> None:
    """Each flap leaves a gap open, and its main runs back through it."""
    truth.change(valve_leak=p["leak_m3h"] / HOUR_S)


def _sticking_check_valve(truth: ElasticTruth, p: Given) -> None:
    """The flap hangs, and needs more than the head of the main to come off its seat."""
    truth.change(valve_barrier_m=truth.of_pump(truth.spec.valve_barrier_m, p["pump"], p["opening_m"]))


def _motor_slip(truth: ElasticTruth, p: Given) -> None:
    """The file tells the curve at synchronous speed, and the motor slips after Kloss."""
    truth.spec = with_slip(truth.spec, p["slip"])


def _ramp_shape(truth: ElasticTruth, p: Given) -> None:
    """The drive does most of its ramp at first, or steps smoothly, and tells a straight one."""
    truth.change(ramp_form=EARLY if p["form"] == "early" else SMOOTH, ramp_bend=p["bend"])


def _load_dependent_power(truth: ElasticTruth, p: Given) -> None:
    """The machine takes what it needs, where the file has it follow the frequency."""
    truth.change(shutoff_share=p["shutoff_share"], rated_w=truth.spec.rated_w * p["load_factor"])


def _supply_voltage_variation(truth: ElasticTruth, p: Given) -> None:
    """The grid sags in the evening and rises at night, and wanders; seen in the power alone."""
    turn = 2.0 * np.pi * (truth.time_s / DAY_S - p["phase"])
    daily = 0.9 * np.sin(turn) + 0.25 * np.sin(2.0 * turn)
    fast = wandering(turn.size, p["fast_s"], truth.rng)
    truth.weather.voltage[:] *= 1.0 + p["swing"] * daily + p["fast_share"] * p["swing"] * fast


def _control_delay(truth: ElasticTruth, p: Given) -> None:
    """The level comes to the PLC over a slow radio link: polled, and old when it arrives."""
    truth.change(poll_s=p["poll_s"], old_s=p["old_s"])


def _threshold_shift(truth: ElasticTruth, p: Given) -> None:
    """Somebody has changed the levels in the PLC."""
    truth.change(start_m=truth.spec.start_m + p["start_m"], stop_m=truth.spec.stop_m + p["stop_m"])


def _level_sensor_lag(truth: ElasticTruth, p: Given) -> None:
    """Two filters in a row, of transmitter and input card."""
    truth.change(level_filter_s=p["filter_s"])


def _level_quantisation(truth: ElasticTruth, p: Given) -> None:
    """Counts of a converter with few bits, from the foot of its range."""
    instrument = truth.instruments.of("level_m")
    instrument.step, instrument.step_from = p["quantum_m"], p["range_from_m"]


def _flow_meter_gain(truth: ElasticTruth, p: Given) -> None:
    """Set up for another bore."""
    truth.instruments.of("flow_m3h").factor = p["factor"]


def _power_meter_gain(truth: ElasticTruth, p: Given) -> None:
    """Current transformers of another ratio than in the transducer."""
    truth.instruments.of("power_kw").factor = p["factor"]


def _flow_meter_lag(truth: ElasticTruth, p: Given) -> None:
    """Two filters in a row."""
    truth.change(flow_filter_s=p["filter_s"])


def _flow_low_cutoff(truth: ElasticTruth, p: Given) -> None:
    """Of the velocity, before the meter's own damping."""
    truth.change(flow_cutoff=p["cutoff_m3h"] / HOUR_S)


def _head_sensor_offset(truth: ElasticTruth, p: Given) -> None:
    """Mounted above or below where its head is told."""
    truth.instruments.of("head_m").shift = p["offset_m"]


def _channel_delay(truth: ElasticTruth, p: Given) -> None:
    """The value of a slow register: late, by a little more or less from time to time."""
    jitter_s = p["jitter_s"] * wandering(truth.time_s.size, 60.0, truth.rng)
    truth.instruments.of(p["channel"]).delay_s = np.maximum(p["delay_s"] + jitter_s, 0.0)


def _report_by_exception(truth: ElasticTruth, p: Given) -> None:
    """Sent on change, but not within a pause."""
    instrument = truth.instruments.of(p["channel"])
    instrument.threshold, instrument.pause_s, instrument.report_s = p["deadband"], p["pause_s"], p["report_s"]


def _worn(d: Sizes) -> Parameters:
    vane, ring = d.size(0.03, 0.15), d.size(0.03, 0.12)
    which = d.rng.integers(3)
    return {"vane_share": 0.0 if which == 1 else vane, "ring_share": 0.0 if which == 0 else ring, "pump": d.pump()}


def _levels(d: Sizes) -> Parameters:
    size = d.size(0.03, 0.25) * d.depth_m
    lowest_m = 0.15 - min(d.station.control.stop_levels_m)
    start_m, stop_m = ((size, 0.0), (0.0, size), (size, size), (size, -size))[int(d.rng.integers(4))]
    sign = d.sign()
    return {"start_m": digits(sign * start_m), "stop_m": digits(max(sign * stop_m, lowest_m))}


def _deadband(d: Sizes) -> Parameters:
    channel = d.one_of("level_m", "flow_m3h", "head_m", "power_kw")
    unit = {"level_m": 1.0, "flow_m3h": d.flow_m3h, "head_m": d.head_m, "power_kw": d.power_kw}[channel]
    return {
        "channel": channel,
        "deadband": digits(unit * d.size(0.03, 0.12)),
        "pause_s": d.even(1.0, 4.0),
        "report_s": d.size(300.0, 1800.0),
    }


LIBRARY_FORMS: dict[str, ElasticKind] = {
    "friction_bias": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {
            "factor": digits(math.exp(d.sign() * math.log(d.size(1.08, 1.9)))),
            "wall_share": d.even(0.0, 0.7),
        },
        _friction_bias,
    ),
    "static_head_bias": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {
            "offset_m": digits(max(d.sign() * d.head_m * d.size(0.03, 0.2), -0.8 * d.station.mains[0].lift_at_zero_m))
        },
        _static_head_bias,
    ),
    "level_dependent_static_head": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {"reference_level_m": d.even(0.0, 1.5 * d.station.control.start_levels_m[0])},
        _level_dependent_static_head,
    ),
    "common_header": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {"shared_fraction": d.even(0.4, 1.0)},
        _common_header,
        needs_two_pumps=True,
    ),
    "water_inertia": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m"),
        lambda d: {"column_s2_m2": digits(d.size(2.0, 12.0) * d.head_m / (d.flow_m3h / HOUR_S))},
        _water_inertia,
    ),
    "air_pocket": ElasticKind(
        "rising_main",
        ("flow_m3h", "head_m", "level_m"),
        lambda d: {
            "head_m": digits(d.head_m * d.size(0.05, 0.25)),
            "fills_s": d.size(60.0, 400.0),
            "cleared_s": d.size(30.0, 150.0),
        },
        _air_pocket,
    ),
    "sump_area_profile": ElasticKind(
        "sump",
        ("level_m",),
        lambda d: {
            "form": d.one_of("fillet", "wedge"),
            "floor_share": d.even(0.1, 0.6),
            "floor_height_m": digits(d.station.control.stop_levels_m[0] + d.even(0.3, 0.95) * d.depth_m),
        },
        _sump_area_profile,
    ),
    "unmetered_inflow": ElasticKind(
        "sump",
        ("level_m",),
        lambda d: {"flow_m3h": digits(d.flow_m3h * d.size(0.03, 0.2)), "breath": d.even(0.0, 0.15)},
        _unmetered_inflow,
        is_behind_meter=True,
    ),
    "pump_wear": ElasticKind("pump", ("flow_m3h", "head_m", "level_m"), _worn, _pump_wear),
    "ragging": ElasticKind(
        "pump",
        ("flow_m3h", "head_m"),
        lambda d: {"throttle_share": d.size(0.06, 0.4), "gathered_s": d.size(60.0, 400.0), "pump": d.pump()},
        _ragging,
    ),
    "check_valve_leak": ElasticKind(
        "pump",
        ("level_m",),
        lambda d: {
            "leak_m3h": digits(
                d.flow_m3h * d.size(0.03, 0.1) / math.sqrt(max(d.station.mains[0].lift_at_zero_m, 0.5))
            )
        },
        _check_valve_leak,
    ),
    "sticking_check_valve": ElasticKind(
        "pump",
        ("flow_m3h", "head_m"),
        lambda d: {
            "opening_m": digits(
                d.size(0.2, 0.7) * (d.station.pump[0].coefficients[0] - d.station.mains[0].lift_at_zero_m)
            ),
            "pump": d.pump(),
        },
        _sticking_check_valve,
    ),
    "motor_slip": ElasticKind(
        "drive", ("flow_m3h", "head_m", "level_m"), lambda d: {"slip": d.size(0.02, 0.09)}, _motor_slip
    ),
    "ramp_shape": ElasticKind(
        "drive",
        ("flow_m3h", "head_m"),
        lambda d: {"form": d.one_of("early", "smooth"), "bend": d.even(0.4, 0.9)},
        _ramp_shape,
    ),
    "load_dependent_power": ElasticKind(
        "drive",
        ("power_kw",),
        lambda d: {"shutoff_share": d.even(0.3, 0.6), "load_factor": d.even(0.85, 1.1)},
        _load_dependent_power,
    ),
    "supply_voltage_variation": ElasticKind(
        "drive",
        ("power_kw",),
        lambda d: {
            "swing": d.size(0.015, 0.06),
            "phase": d.even(0.0, 1.0),
            "fast_share": d.even(0.1, 0.5),
            "fast_s": d.size(60.0, 900.0),
        },
        _supply_voltage_variation,
    ),
    "control_delay": ElasticKind(
        "controller", ("level_m",), lambda d: {"poll_s": d.even(1.0, 8.0), "old_s": d.size(4.0, 30.0)}, _control_delay
    ),
    "threshold_shift": ElasticKind("controller", ("level_m",), _levels, _threshold_shift),
    "level_sensor_lag": ElasticKind(
        "level_sensor", ("level_m",), lambda d: {"filter_s": d.size(4.0, 40.0)}, _level_sensor_lag
    ),
    "level_quantisation": ElasticKind(
        "level_sensor",
        ("level_m",),
        lambda d: {"quantum_m": d.size(0.015, 0.08), "range_from_m": d.even(-0.5, 0.0)},
        _level_quantisation,
    ),
    "flow_meter_gain": ElasticKind(
        "flow_meter",
        ("flow_m3h",),
        lambda d: {"factor": digits(1.0 + d.sign() * d.size(0.03, 0.15))},
        _flow_meter_gain,
    ),
    "power_meter_gain": ElasticKind(
        "power_meter",
        ("power_kw",),
        lambda d: {"factor": digits(1.0 + d.sign() * d.size(0.03, 0.2))},
        _power_meter_gain,
    ),
    "flow_meter_lag": ElasticKind(
        "flow_meter", ("flow_m3h",), lambda d: {"filter_s": d.size(3.0, 20.0)}, _flow_meter_lag
    ),
    "flow_low_cutoff": ElasticKind(
        "flow_meter",
        ("flow_m3h",),
        lambda d: {"cutoff_m3h": digits(d.flow_m3h * d.even(0.2, 0.6))},
        _flow_low_cutoff,
    ),
    "head_sensor_offset": ElasticKind(
        "head_sensor",
        ("head_m",),
        lambda d: {"offset_m": digits(d.sign() * d.head_m * d.size(0.03, 0.12))},
        _head_sensor_offset,
    ),
    "channel_delay": ElasticKind(
        "telemetry",
        (),
        lambda d: {
            "channel": d.one_of("level_m", "frequency_hz", "flow_m3h", "head_m", "power_kw"),
            "delay_s": d.size(3.0, 25.0),
            "jitter_s": d.even(0.0, 0.5),
        },
        _channel_delay,
    ),
    "report_by_exception": ElasticKind("telemetry", (), _deadband, _report_by_exception),
}
