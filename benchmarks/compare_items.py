"""The items of a comparison of two checkouts: stations, scenarios, and what is done with them."""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HOUR_S = 3600
DETECTORS = "all"
PRESETS = {"nominal": 0.6, "blockage": 0.6, "clogging": 0.8, "demo": 0.75, "paper": 1.8}
"""Days of each scenario that comes with the package."""
ROWS = 50_000
"""A state of the detector is kept before the middle of the run, and the rest is judged from there."""
MAIN = "[rising_main]\nstatic_head_m = 2.0\nfriction_h2_m5 = 6.0e-4\n"
PUMP = "[[pump]]\ncurve = [36.0, -0.02333, -1.3333e-4]\n"
WELL = 'name = "{name}"\n[sump]\narea_m2 = 8.0\n'
LEVELS = "start_levels_m = [1.6, 1.8, 2.0]\nstop_levels_m = [0.5, 0.8, 1.0]\n"
SENSORS = "[sensors]\ncorrelation = 0.9\n"
STATIONS = {
    "header": WELL + PUMP * 3 + MAIN + 'layout = "common"\n[control]\n' + LEVELS,
    "pid": WELL + PUMP * 3 + MAIN + '[control]\nmode = "pid"\nmin_frequency_hz = 25.0\n' + LEVELS,
    "pid-header": WELL
    + PUMP * 3
    + MAIN
    + 'layout = "common"\n[control]\nmode = "pid"\nmin_frequency_hz = 25.0\nsetpoint_m = 1.2\n'
    + LEVELS,
    "unequal": WELL
    + "[[pump]]\ncurve = [36.0, -0.02333, -1.3333e-4]\n[[pump]]\ncurve = [30.0, -0.02, -2.0e-4]\n"
    + "[[pump]]\npoints = [[0.0, 40.0], [100.0, 35.0], [200.0, 26.0], [300.0, 14.0]]\n"
    + MAIN
    + '[control]\nrotation = "least_run_time"\n'
    + LEVELS
    + '[electrical]\npower_model = "load"\n'
    + SENSORS,
    "single": WELL + PUMP + MAIN + "[control]\nstart_levels_m = [1.6]\nstop_levels_m = [0.5]\n",
    "profile": 'name = "{name}"\n[sump]\narea_m2 = 8.0\nprofile = [[0.0, 4.0], [1.0, 8.0], [3.0, 9.0]]\n'
    "overflow_level_m = 3.5\n"
    + PUMP * 2
    + MAIN
    + "[control]\nstart_levels_m = [1.6, 1.8]\nstop_levels_m = [0.5, 0.8]\n"
    + 'max_starts_per_hour = 6\nrotation = "fixed"\n',
}
PLAIN = 'name = "{name}"\nduration_s = 50_400\n[inflow]\n{inflow}\n'
INFLOWS = {
    "diurnal": 'kind = "diurnal"',
    "catchment": 'kind = "catchment"\nstorms_per_day = 2.0',
    "recorded": 'kind = "recorded"\ntime_s = [0.0, 3600.0, 9000.0]\nflow_m3h = [60.0, 180.0, 20.0]',
}
PUMP_FAULTS = {
    "blockage": "speed_loss = 0.2",
    "impeller_wear": "head_loss = 0.1",
    "wear_ring_leakage": "leak_m3h = 25.0",
    "ragging": "speed_loss = 0.2",
    "check_valve_leak": "leak_m3h = 10.0",
    "drive_trip": "",
}
STATION_FAULTS = {
    "pipe_clogging": "friction_rise = 0.8\nstatic_rise_m = 0.4",
    "partly_closed_valve": "opening = 0.2",
    "air_pocket": "static_rise_m = 1.5",
    "frozen_plc": 'shape = "intermittent"\nperiod_s = 3000.0',
}
SENSOR_FAULTS = {
    "sensor_stuck-flow": 'channel = "flow_m3h"\npump = 1',
    "sensor_stuck-head": 'channel = "head_m"\npump = 2',
    "sensor_stuck-level": 'channel = "level_m"\nshape = "intermittent"\nperiod_s = 1800.0\nduty = 0.2',
    "sensor_stuck-power": 'channel = "power_kw"\npump = 1',
    "sensor_drift-head": 'channel = "head_m"\npump = 1\nbias_per_hour = 0.4',
    "sensor_bias-flow": 'channel = "flow_m3h"\npump = 3\nbias = -15.0',
    "sensor_bias-inflow": 'channel = "inflow_m3h"\nbias = 20.0',
    "sensor_noise-head": 'channel = "head_m"\npump = 1\nfactor = 8.0',
}
EFFECTS = {
    "air_pocket": "head_m = 3.0\ngrowth_s = 900.0",
    "channel_delay": 'channel = "head_m"\ndelay_s = 8.0',
    "check_valve_leak": "leak_m3h = 12.0",
    "common_header": "shared_fraction = 0.6",
    "constant_losses": "losses_share = 0.04",
    "control_delay": "delay_s = 12.0",
    "flow_low_cutoff": "cutoff_m3h = 40.0",
    "flow_meter_gain": "factor = 0.93",
    "flow_meter_lag": "lag_s = 12.0",
    "friction_bias": "factor = 1.3",
    "head_sensor_offset": "offset_m = 0.8",
    "level_dependent_static_head": "slope = 1.0\nreference_level_m = 1.0",
    "level_quantisation": "quantum_m = 0.02",
    "level_sensor_lag": "lag_s = 10.0",
    "load_dependent_power": "share = 1.0",
    "motor_slip": "slip = 0.04",
    "power_meter_gain": "factor = 0.9",
    "pump_wear": "head_loss = 0.1\npump = 2",
    "ragging": "speed_loss = 0.1\npump = 1",
    "ramp_shape": "power = 2.0\nlag_s = 3.0",
    "report_by_exception": 'channel = "level_m"\ndeadband = 0.04',
    "static_head_bias": "offset_m = 1.2",
    "sticking_check_valve": "opening_m = 8.0",
    "sump_area_profile": "bottom_factor = 0.6\nheight_m = 1.0",
    "supply_voltage_variation": "daily_amplitude = 0.05",
    "threshold_shift": "start_m = 0.15",
    "unmetered_inflow": "flow_m3h = 15.0",
    "water_inertia": "inertia_s2_m2 = 800.0",
}
DERIVED: dict[str, dict[str, Any]] = {
    "every-5-s": {"every": 5},
    "every-10-s": {"every": 10},
    "every-30-s": {"every": 30},
    "every-60-s": {"every": 60},
    "missing-values": {"missing": 0.02},
    "many-missing-values": {"missing": 0.4, "seed": 2},
    "without-inflow-and-power": {"without": ["inflow", "power_kw"]},
    "without-running": {"without": ["running"]},
    "without-flow": {"without": ["_flow_m3h"]},
    "without-level": {"without": ["level_m"]},
    "late-and-doubled": {"is_disordered": True},
    "gap": {"gap": [60_000, 75_000]},
    "begins-in-a-run": {"skip": 4_321},
}
DIAGNOSES: dict[str, tuple[str, tuple[str, ...], list[str]]] = {
    "none": ("alpha", (), []),
    "friction": ("alpha", ("friction_bias",), []),
    "lag-and-gain": ("alpha", ("level_sensor_lag", "flow_meter_gain"), []),
    "wear-of-one-pump": ("alpha", ("pump_wear",), ["--without", "ragging"]),
    "header": ("header", ("static_head_bias", "report_by_exception"), []),
    "only": ("unequal", ("head_sensor_offset",), ["--only", "head_sensor_offset", "--only", "friction_bias"]),
}
PREPARATION = """max_gap_s = 10.0
[[scale]]
column = "pump1_flow_m3h"
factor = 1.02
[[offset]]
column = "level_m"
value = 0.05
start = 2020-01-01T00:00:00Z
end = 2020-01-02T00:00:00Z
"""
ALARM_STATE = {
    "version": "wetwell.alarm-state/1",
    "book": {
        "entries": [
            {
                "station": "alpha",
                "rule": "pump_fault",
                "pump": 1,
                "standing": {
                    "state": "shelved",
                    "is_active": True,
                    "raised_ns": 1_790_000_000_000_000_000,
                    "until_ns": 1_790_000_900_000_000_000,
                    "by": "ada",
                    "reason": "pump is being cleaned",
                },
                "delay": {"is_active": True, "held_s": 3.5, "last_ns": 1_790_000_000_000_000_000},
                "text": "pump fault",
                "advice": "look",
                "time_ns": 1_790_000_000_000_000_001,
                "changes_ns": [1_790_000_000_000_000_000],
            }
        ],
        "answers": [],
        "calls_ns": [1_790_000_000_000_000_000],
        "is_flood": False,
    },
    "stations": {
        "alpha": {
            "time_ns": 1_790_000_000_000_000_000,
            "seq": 77,
            "last_verdicts_ns": {"1": 1_790_000_000_000_000_000},
            "services": ["detector"],
        }
    },
}
BAD_STATIONS = {
    "unknown-key": WELL + PUMP + "[sumpf]\narea_m2 = 1.0\n",
    "no-pump": WELL,
    "negative-area": 'name = "x"\n[sump]\narea_m2 = -8.0\n' + PUMP,
    "rising-curve": WELL + "[[pump]]\ncurve = [36.0, 0.1, 1e-4]\n",
    "crossed-levels": WELL + PUMP + "[control]\nstart_levels_m = [0.5]\nstop_levels_m = [1.6]\n",
    "bad-name": 'name = "a b/c"\n[sump]\narea_m2 = 8.0\n' + PUMP,
    "unknown-effect": WELL + PUMP + '[[effect]]\nname = "gremlins"\n',
    "effect-out-of-range": WELL + PUMP + '[[effect]]\nname = "friction_bias"\nfactor = 99.0\n',
    "effect-typo": WELL + PUMP + '[[effect]]\nname = "friction_bias"\nfaktor = 1.1\n',
    "not-toml": "name = \n",
    "inoperable": WELL + PUMP + "[rising_main]\nstatic_head_m = 90.0\n",
}
BAD_SCENARIOS = {
    "unknown-fault": '[[fault]]\nkind = "gremlins"\nstart_s = 1\nend_s = 2\n',
    "fault-without-end": '[[fault]]\nkind = "blockage"\npump = 1\nstart_s = 1\n',
    "fault-backwards": '[[fault]]\nkind = "blockage"\npump = 1\nstart_s = 9\nend_s = 2\n',
    "fault-of-no-pump": '[[fault]]\nkind = "blockage"\npump = 9\nstart_s = 1\nend_s = 2\n',
    "unknown-channel": '[[fault]]\nkind = "sensor_stuck"\nchannel = "colour"\nstart_s = 1\nend_s = 2\n',
}
BAD_RECORDINGS = {
    "empty.csv": "",
    "no-time.csv": "level_m,pump1_flow_m3h\n1.0,2.0\n",
    "no-pump.csv": "time,level_m\n2026-01-01T00:00:00Z,1.0\n",
    "text.csv": "time,level_m,pump1_flow_m3h\n2026-01-01T00:00:00Z,high,1.0\n",
    "bad-time.csv": "time,level_m,pump1_flow_m3h\nyesterday,1.0,1.0\n",
    "twice.csv": "time,level_m,level_m,pump1_flow_m3h\n2026-01-01T00:00:00Z,1.0,1.0,1.0\n",
    "short.csv": "time,level_m,pump1_flow_m3h,extra\n2026-01-01T00:00:00Z,1.0,1.0,4\n",
    "recording.xlsx": "no\n",
    "not-parquet.parquet": "no\n",
}
BAD_COMMANDS = (
    (),
    ("fly",),
    ("simulate",),
    ("simulate", "--station", "alpha", "--out", "a.csv", "--days", "-1"),
    ("simulate", "--station", "alpha", "--out", "a.csv", "--seed", "x"),
    ("simulate", "--station", "alpha", "--out", "no/such/folder/a.csv", "--days", ".01"),
    ("simulate", "--out", "a.csv", "--station", "gamma"),
    ("detect", "--station", "alpha", "--recording", "none.csv", "--out", "a.jsonl"),
    ("detect", "--recording", "none.csv", "--out", "a.jsonl", "--station", "none.toml"),
    ("gap", "diagnose", "--out", "a"),
    ("gap", "diagnose", "--station", "alpha", "--out", "a", "--recording", "none.csv", "--only", "gremlins"),
    ("gap", "trial", "--out", "a", "--kinds", "gremlins"),
    ("backtest", "--station", "alpha", "--out", "a", "--detectors", "gremlins", "--scenario", "nominal"),
    ("backtest", "--out", "a"),
    ("dataset", "--check", "none"),
    ("config", "check", "none.toml"),
    ("config", "show", "--config", "bad.toml"),
    ("gateway", "check", "bad.toml"),
    ("history", "--kind", "gremlins"),
    ("export", "--station", "alpha", "--out", "a.csv", "--from", "yesterday"),
    ("convert", "none.csv", "--out", "a.csv"),
)


@dataclass(frozen=True)
class Step:
    """A command or an act of the driver, and the exit codes that are meant."""

    name: str
    arguments: tuple[Any, ...]
    act: str | None = None
    codes: tuple[str, ...] = ("0",)

    def as_json(self) -> dict[str, Any]:
        """What the driver reads."""
        plain: dict[str, Any] = {"name": self.name, "arguments": list(self.arguments)}
        return plain | ({"act": self.act} if self.act else {})


@dataclass(frozen=True)
class Item:
    """Steps that are run one after the other in a folder of their own, which begins with some files."""

    name: str
    steps: tuple[Step, ...]
    files: dict[str, str] = field(default_factory=dict)
    is_recording: bool = False


def items() -> list[Item]:
    """All items; what takes longest comes first."""
    return [*_diagnoses(), *_batches(), *_recordings(), *_lists(), *_refusals()]


def _command(*arguments: str, name: str | None = None, codes: tuple[str, ...] = ("0",)) -> Step:
    return Step(name or "-".join(arguments[:1]) or "nothing", arguments, codes=codes)


def _act(act: str, *arguments: Any, name: str | None = None) -> Step:
    return Step(name or act, arguments, act)


def _simulated(station: str, scenario: str, seed: int, days: float, out: str = "recording.parquet") -> Step:
    given = ("--station", station, "--scenario", scenario, "--seed", str(seed), "--days", str(days), "--out", out)
    return _command("simulate", *given)


def _judged(station: str = "alpha", source: str = "recording.parquet") -> Step:
    return _command("detect", "--station", station, "--recording", source, "--out", "verdicts.jsonl")


def _from_states(station: str, source: str = "recording.parquet", rows: int = ROWS) -> tuple[Step, ...]:
    """The same verdicts sample by sample, with states of the detector, and from the old checkout's states on."""
    states = [rows // 5, rows * 3 // 5]
    first = _act("judge", station, source, 0, states, "detector", name="judge")
    later = (_act("judge", station, source, at, [], "detector", name=f"judge-from-{at}") for at in states)
    return (first, *later)


def _station(name: str, effects: tuple[str, ...] = ()) -> str:
    text = STATIONS[name].format(name=name) if name in STATIONS else _alpha(name)
    return text + "".join(f'[[effect]]\nname = "{effect}"\n{EFFECTS[effect]}\n' for effect in effects)


def _alpha(name: str) -> str:
    """The built-in station under another name."""
    return WELL.format(name=name) + PUMP * 3 + MAIN + "[control]\n" + LEVELS


def _recordings() -> Iterator[Item]:
    for seed, (scenario, days) in enumerate(PRESETS.items(), 1):
        steps = (_simulated("alpha", scenario, seed, days), _judged(), *_from_states("alpha"))
        yield Item(f"scenario-{scenario}", steps, is_recording=True)
    for seed, name in enumerate(STATIONS, 11):
        steps = (
            _simulated("station.toml", "demo", seed, 0.75, "recording.csv"),
            _judged("station.toml", "recording.csv"),
            *_from_states("station.toml", "recording.csv"),
        )
        if name == "single":  # the scenario speaks of pump 2
            steps = (_simulated("station.toml", "paper", seed, 0.6, "recording.csv"), *steps[1:])
        yield Item(f"station-{name}", steps, {"station.toml": _station(name)}, is_recording=True)
    for seed, (name, inflow) in enumerate(INFLOWS.items(), 21):
        steps = (_simulated("alpha", "scenario.toml", seed, 0.5), _judged())
        yield Item(
            f"inflow-{name}", steps, {"scenario.toml": PLAIN.format(name=name, inflow=inflow)}, is_recording=True
        )
    faults = {f"{kind}": f"pump = 1\n{figures}" for kind, figures in PUMP_FAULTS.items()}
    for seed, (name, figures) in enumerate((faults | STATION_FAULTS | SENSOR_FAULTS).items(), 31):
        kind = name.partition("-")[0]
        fault = f'[[fault]]\nkind = "{kind}"\nstart_s = 28_800\nend_s = 39_600\n{figures}\n'
        text = PLAIN.format(name=kind, inflow='kind = "empirical"') + fault
        steps = (_simulated("alpha", "scenario.toml", seed, 14 / 24), _judged(), *_from_states("alpha", rows=45_000))
        yield Item(f"fault-{name}", steps, {"scenario.toml": text}, is_recording=True)
    for seed, effect in enumerate(EFFECTS, 61):
        steps = (_simulated("station.toml", "nominal", seed, 0.35), _judged("station.toml"))
        yield Item(f"effect-{effect}", steps, {"station.toml": _station("plant", (effect,))}, is_recording=True)
    yield from _derived()
    yield from _foreign()


def _derived() -> Iterator[Item]:
    for seed, (name, how) in enumerate(DERIVED.items(), 91):
        rows = 120_000 // how.get("every", 1)
        steps = (
            _simulated("alpha", "paper", seed, 1.5, "whole.parquet"),
            _act("derive", "whole.parquet", "recording.parquet", how | {"rows": 120_000}),
            _judged(),
            *_from_states("alpha", rows=rows // 2),
            _command("kpi", "--recording", "recording.parquet", "--json"),
        )
        yield Item(f"polled-{name}", steps, is_recording=True)


def _foreign() -> Iterator[Item]:
    folder = os.environ.get("WETWELL_TEST_DATA")
    found = sorted(Path(folder).glob("skab/**/*.csv.gz")) if folder else []
    for path in found[:: max(len(found) // 6, 1)]:
        steps = (
            _command("convert", "--from", "skab", str(path), "--out", "recording.csv"),
            _judged("single.toml", "recording.csv"),
            _command("kpi", "--recording", "recording.csv", "--json"),
        )
        name = f"skab-{path.parent.name}-{path.name.partition('.')[0]}"
        yield Item(name, steps, {"single.toml": _station("single")}, is_recording=True)


def _diagnoses() -> Iterator[Item]:
    for seed, (name, (station, effects, options)) in enumerate(DIAGNOSES.items(), 121):
        files = {"truth.toml": _station(station, effects), "station.toml": _station(station)}
        given = ("--station", "station.toml", "--recording", "recording.parquet", *options, "--json")
        steps = (
            _simulated("truth.toml", "nominal", seed, 0.4),
            _command("gap", "diagnose", *given, "--out", "gap", name="diagnose", codes=("0", "1")),
        )
        yield Item(f"diagnosis-{name}", steps, files, is_recording=True)


def _batches() -> Iterator[Item]:
    trial = ("--seed", "7", "--cases", "3", "--days", ".3", "--out", "trial", "--recalibration", "--unseen", "--json")
    yield Item("trial", (_command("gap", "trial", *trial, name="trial"),))
    swmm = ("--seed", "8", "--cases", "1", "--days", ".2", "--plant", "swmm", "--kinds", "single", "--out", "trial")
    yield Item("trial-swmm", (_command("gap", "trial", *swmm, name="trial", codes=("0", "2")),))
    station = {"station.toml": _station("plant", ("friction_bias",)), "preparation.toml": PREPARATION}
    source, plant, alpha = ("--recording", "recording.parquet"), ("--station", "station.toml"), ("--station", "alpha")
    prepared = ("--preparation", "preparation.toml")
    yield Item(
        "field-data",
        (
            _simulated("station.toml", "nominal", 131, 0.6, "whole.parquet"),
            _act("derive", "whole.parquet", "recording.parquet", {"is_disordered": True, "gap": [9000, 9900]}),
            _command("prepare", *source, *prepared, "--out", "prepared.csv", "--json"),
            _command("kpi", *source),
            _command("calibrate", *plant, "--recording", "prepared.csv", "--out", "fitted.toml"),
            _command("calibrate", *plant, *source, "--out", "again.toml", "--json", name="calibrate-json"),
            _command(
                "validate", *plant, "--recording", "prepared.csv", "--out", "simulated.csv", "--html", "page.html"
            ),
            _command("validate", *source, "--station", "fitted.toml", *prepared, "--json", name="validate-json"),
            _command("gap", "replay", *plant, *source, "--out", "replayed.csv", name="replay"),
            _command(
                "gap",
                "replay",
                *plant,
                *source,
                "--out",
                "closed.parquet",
                "--closed-loop",
                "--json",
                name="replay-closed",
            ),
        ),
        station,
        is_recording=True,
    )
    many = (*alpha, "--count", "4", "--seed", "3", "--days", ".3", "--workers", "1")
    yield Item(
        "dataset",
        (
            _command("dataset", "--out", "set", *many),
            _command("dataset", "--check", "set", "--json", name="check"),
            _command(
                "dataset",
                "--out",
                "csv",
                *alpha,
                *many[4:],
                "--count",
                "2",
                "--format",
                "csv.gz",
                "--json",
                name="csv",
            ),
            _command("backtest", "--dataset", "set", "--out", "test", "--workers", "1", "--learning-h", "1"),
        ),
    )
    methods = ("--detectors", DETECTORS, "--workers", "1")
    yield Item(
        "backtest",
        (
            _command("backtest", *alpha, "--scenario", "demo", "--days", ".75", "--out", "test", *methods),
            _command(
                "backtest",
                *alpha,
                "--scenario",
                "paper",
                "--days",
                "1",
                "--out",
                "two",
                *methods,
                "--json",
                name="again",
            ),
        ),
    )
    yield Item(
        "history",
        (
            _simulated("alpha", "paper", 141, 1.2),
            _command("import", *alpha, *source, "--data", "history"),
            _command("export", *alpha, "--data", "../../old/history/history", "--out", "all.csv"),
            _command("export", *alpha, "--data", "history", "--out", "all.parquet", "--json", name="export-json"),
        ),
    )
    yield Item(
        "messages-and-states",
        (
            _simulated("alpha", "paper", 142, 0.5),
            _judged(),
            _act("messages", "alpha", "recording.parquet"),
            _act("checkpoint", "alpha", "recording.parquet", 40_000),
            _act("alarm_state", ALARM_STATE),
        ),
    )


def _lists() -> Iterator[Item]:
    steps = [
        _command(name, *([flag] if flag else []), name=f"{name}{flag}")
        for name in ("effects", "faults", "inflows")
        for flag in ("", "--json")
    ]
    files = {f"{name}.toml": _station(name) for name in STATIONS}
    for station in ("alpha", *files):
        steps += [
            _command("modbus-map", "--station", station, name=f"map-{station}"),
            _command("station", "show", station, name=f"show-{station}"),
            _command("station", "show", station, "--json", name=f"show-json-{station}"),
            _command("station", "check", station, name=f"check-{station}"),
        ]
    steps += [
        _command("config", "show", name="config"),
        _command("gateway", "check", "plc.toml", name="check", codes=("0", "2")),
    ]
    helps = ("simulate", "detect", "gap", "backtest", "up", "detector", "historian", "doctor", "gateway", "alarms")
    steps += [_command(name, "--help", name=f"help-{name}") for name in helps]
    yield Item("lists", tuple(steps), files | {"plc.toml": 'station = "alpha"\nhost = "127.0.0.1"\n'})


def _refusals() -> Iterator[Item]:
    refused = ("2",)
    steps = [
        _command(*arguments, name=f"command-{number}", codes=("0", "2"))
        for number, arguments in enumerate(BAD_COMMANDS)
    ]
    files = {"bad.toml": '[detector]\nspeed = "fast"\n'}
    for name, text in BAD_STATIONS.items():
        files[f"{name}.toml"] = text.format(name="x") if text.startswith(WELL) else text
        steps.append(_command("station", "check", f"{name}.toml", name=f"station-{name}", codes=refused))
    for name, text in BAD_SCENARIOS.items():
        files[f"{name}.toml"] = PLAIN.format(name="x", inflow='kind = "empirical"') + text
        given = ("--station", "alpha", "--scenario", f"{name}.toml", "--out", "a.csv", "--days", ".01")
        steps.append(_command("simulate", *given, name=f"scenario-{name}", codes=refused))
    for name, text in BAD_RECORDINGS.items():
        files[name] = text
        codes = ("0", "2") if name == "short.csv" else refused
        for command, out in (("detect", "a.jsonl"), ("prepare", "a.csv"), ("calibrate", "a.toml")):
            given = ("--recording", name, "--out", out)
            given += () if command == "prepare" else ("--station", "alpha")
            steps.append(_command(command, *given, name=f"{command}-{name}", codes=codes))
        steps.append(_command("kpi", "--recording", name, name=f"kpi-{name}", codes=codes))
    yield Item("refusals", tuple(steps), files)
    broken = json.dumps(ALARM_STATE | {"version": "wetwell.alarm-state/9"})
    yield Item("refused-states", (_act("alarm_state", json.loads(broken)),))
