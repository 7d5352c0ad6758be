"""A real station measured: every figure of docs/real-station.md as one JSON object on standard output.

    python benchmarks/real_station.py FOLDER [--plots DIR] [--diagnose]

FOLDER holds the workbook that the owners published (`Hackathon_HSY_data.xlsx`); without it nothing is measured.
Mapping and station file stand in `benchmarks/real_station/`. The first eight days are for calibration, the second
eight are only looked at. `--diagnose` adds the diagnosis of the gap, which takes some minutes.
"""

import argparse
import importlib.metadata
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wetwell.protocols.errors import WetwellError
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.recordings.recording import Recording, read_recording
from wetwell.protocols.station.station_file import EffectTable, Station, load_station
from wetwell.protocols.timestamps import from_iso, to_iso
from wetwell.services.batch.conversion import convert_files
from wetwell.services.batch.gap.diagnosis import THREADS
from wetwell.services.batch.recordings import detect
from wetwell.services.reports.charts import Series, bar_chart, line_chart
from wetwell.sim2real.calibration.calibration import calibrate
from wetwell.sim2real.calibration.comparison import Comparison, compare
from wetwell.sim2real.calibration.estimates import Estimate
from wetwell.sim2real.calibration.fitted_station import with_estimates
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.simulator.effects.effect import Effect

HERE = Path(__file__).parent / "real_station"
WORKBOOK = "Hackathon_HSY_data.xlsx"
SECOND_BEGINS = "2024-11-23T00:00:00+02:00"
LOW_RUNS = ("2024-11-29T05:30:00+02:00", "2024-11-29T13:30:00+02:00")
JUDGED = ("2024-11-28T12:00:00+02:00", "2024-11-30T00:00:00+02:00")
"""Verdicts from before the low runs to the end of their day."""
JUDGED_PUMPS = ("1.1", "1.2", "2.2", "2.3", "2.4")
QUANTITIES: tuple[AnalogueQuantity, ...] = ("flow_m3h", "power_kw")
TRIED = ("friction_bias", "static_head_bias", "pump_wear", "flow_meter_gain")
"""Effects that the diagnosis may try: what steady running shows of pumps, mains and meters."""
LONG_RUN_ROWS = 8
"""Steady rows from which on a run is long enough to see whether it loses flow: two hours."""
PARTS = {"curves": ("head_scale", "flow_scale"), "mains": ("_level_m", "friction_h2_m5"), "power": ("power_",)}


def between(recording: Recording, begin_ns: int, end_ns: int) -> Recording:
    """Rows of a stretch of time."""
    rows = (recording.time_ns >= begin_ns) & (recording.time_ns < end_ns)
    return replace(
        recording,
        time_ns=recording.time_ns[rows],
        columns={name: values[rows] for name, values in recording.columns.items()},
    )


def figures(comparison: Comparison) -> dict[str, Any]:
    """Errors in steady rows of all pumps, and of each pump and main."""
    return {
        quantity: {
            error.what: {
                "rows": error.steady_rows,
                "median": rounded(error.steady_median),
                "rms": rounded(error.steady_rms),
                "bias": rounded(error.steady_bias),
                "rms_of_all_rows": rounded(error.rms),
            }
            for error in comparison.errors(quantity)
            if error.steady_rows
        }
        for quantity in QUANTITIES
    }


def rounded(value: float, digits: int = 4) -> float | None:
    """A figure as it is printed."""
    return round(float(value), digits) if np.isfinite(value) else None


def without(estimates: Iterable[Estimate], keys: tuple[str, ...]) -> list[Estimate]:
    """Estimates but those of a part of the station."""
    return [one for one in estimates if not any(key in one.name for key in keys)]


def lost_in_runs(comparison: Comparison) -> dict[str, Any]:
    """Flow that long steady stretches lose against the station from their first two rows to their last two."""
    lost: dict[str, Any] = {}
    told, measured = comparison.told["flow_m3h"], comparison.measured["flow_m3h"]
    for i, name in enumerate(comparison.names):
        steady = comparison.is_steady[i] & (measured[i] > 0.0)
        ends = np.flatnonzero(np.diff(np.concatenate([[False], steady, [False]]).astype(int)))
        changes = []
        for begin, end in ends.reshape(-1, 2):
            if end - begin >= LONG_RUN_ROWS:
                ratio = measured[i, begin:end] / told[i, begin:end]
                changes.append(float(ratio[-2:].mean() / ratio[:2].mean() - 1.0))
        lost[f"pump {name}"] = {
            "stretches": len(changes),
            "median": rounded(np.median(changes)) if changes else None,
            "worst": rounded(min(changes)) if changes else None,
        }
    return lost


def low_runs(recording: Recording, comparison: Comparison) -> dict[str, Any]:
    """Measured less told flow of each pump while it ran in the morning of 29 November."""
    begin_ns, end_ns = map(from_iso, LOW_RUNS)
    rows = (recording.time_ns >= begin_ns) & (recording.time_ns < end_ns)
    result = {}
    for i, name in enumerate(comparison.names):
        measured, told = comparison.measured["flow_m3h"][i, rows], comparison.told["flow_m3h"][i, rows]
        whole = (measured > 0.0) & (told > 0.7 * np.max(told, initial=0.0))
        if whole.sum() >= 4:
            result[f"pump {name}"] = {
                "rows": int(whole.sum()),
                "median_m3h": rounded(np.median((measured - told)[whole]), 0),
                "share": rounded(np.median(measured[whole] / told[whole]) - 1.0, 3),
            }
    return result


def judged(station: Station, recording: Recording, room: Path) -> dict[str, Any]:
    """What the detector says of the second week, having seen both: verdicts by pump and state."""
    out = room / "verdicts.jsonl"
    try:
        result = detect(station, recording, out)
    except WetwellError as error:
        return {"refused": str(error)}
    verdicts = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]
    counts = Counter(
        f"pump {station.pump_names[verdict['pump'] - 1]}: {verdict['state']}"
        for verdict in verdicts
        if from_iso(verdict["time"]) >= from_iso(SECOND_BEGINS)
    )
    return {
        "counts": result.get("counts"),
        "second_week": dict(sorted(counts.items())),
        "about_29_november": judged_on_29_november(station, verdicts),
    }


def judged_on_29_november(station: Station, verdicts: list[dict[str, Any]]) -> dict[str, Any]:
    """What was said of pumps about 29 November: states, times of faults, least and largest shifts of head."""
    found: dict[str, Any] = {}
    for name in JUDGED_PUMPS:
        own = [
            verdict
            for verdict in verdicts
            if station.pump_names[verdict["pump"] - 1] == name
            and from_iso(JUDGED[0]) <= from_iso(verdict["time"]) < from_iso(JUDGED[1])
        ]
        shifts_m = [one["evidence"]["shift_m"]["pump"] for one in own if "shift_m" in one["evidence"]]
        found[f"pump {name}"] = {
            "states": dict(Counter(one["state"] for one in own)),
            "pump_faults": [one["time"] for one in own if one["state"] == "pump_fault"],
            "shift_m": [rounded(min(shifts_m), 1), rounded(max(shifts_m), 1)] if shifts_m else None,
        }
    return found


def diagnosed(station: Station, weeks: dict[str, Recording]) -> dict[str, Any]:
    """Diagnosis of the first week under a station, and what each effect alone closes of the second."""
    begin_s, cpu_s = time.monotonic(), time.process_time()
    with ThreadPoolExecutor(THREADS) as pool:
        found = diagnose(weeks["first"], station, only=TRIED, each=pool.map)
    seconds = time.monotonic() - begin_s, time.process_time() - cpu_s
    report = found.report()

    def seen(effects: Iterable[Effect]) -> dict[str, Any]:
        tables = tuple(EffectTable.model_validate(effect.model_dump()) for effect in effects)
        closed = station.model_copy(update={"effect": (*station.effect, *tables)})
        before, after = (compare(weeks["second"], one) for one in (station, closed))
        return {
            quantity: {
                "median": rounded(np.median(np.abs(after.steady_errors(quantity)))),
                "shrinkage_of_median": rounded(1.0 - _median(after, quantity) / _median(before, quantity), 3),
                "shrinkage_of_rms": rounded(1.0 - _rms(after, quantity) / _rms(before, quantity), 3),
            }
            for quantity in QUANTITIES
        }

    told = {one.name: one for one in report.candidates}
    return {
        "seconds": round(seconds[0]),
        "processor_seconds": round(seconds[1]),
        "verdict": report.verdict,
        "next_experiment": report.next_experiment,
        "notes": list(report.notes),
        "gap": json.loads(report.gap.model_dump_json()),
        "not_tested": [json.loads(one.model_dump_json()) for one in report.not_tested],
        "effects": [json.loads(one.model_dump_json()) for one in report.effects],
        "report_seen_in_second_week": seen(found.station.effect[len(station.effect) :]),
        "singles": [
            {
                "effect": json.loads(one.fit.effects[0].model_dump_json()),
                "told": told[one.fit.names[0]].shrinkage,
                "seen_in_second_week": seen(one.fit.effects),
            }
            for one in found.attribution.singles
            if one.fit.names[0] in told
        ],
    }


def _median(comparison: Comparison, quantity: AnalogueQuantity) -> float:
    return float(np.median(np.abs(comparison.steady_errors(quantity))))


def _rms(comparison: Comparison, quantity: AnalogueQuantity) -> float:
    return float(np.sqrt(np.mean(comparison.steady_errors(quantity) ** 2)))


def pictures(
    folder: Path, comparisons: dict[str, Comparison], second: Recording, parts: dict[str, dict[str, Any]]
) -> None:
    """Errors by pump before and after, what each part closes, and how pumps lose flow within runs."""
    folder.mkdir(parents=True, exist_ok=True)
    names = [name for name in comparisons["fitted"].names if name != "1.3"]

    def medians(comparison: Comparison, quantity: AnalogueQuantity) -> list[float]:
        told = {error.what: 100.0 * error.steady_median for error in comparison.errors(quantity)}
        return [told[f"pump {name}"] for name in names]

    for quantity in QUANTITIES:
        word = quantity.split("_")[0]
        chart = bar_chart(
            f"Median error of the {word} in the second week",
            [f"pump {name}" for name in names],
            {label: medians(comparisons[label], quantity) for label in ("datasheets", "fitted")},
            y_label="%",
        )
        (folder / f"real-station-{word}.svg").write_text(chart + "\n", encoding="utf-8")
    chart = bar_chart(
        "Median error of the second week, by what of the calibration is used",
        list(parts),
        {
            word: [100.0 * (part[quantity]["all pumps"]["median"] or 0.0) for part in parts.values()]
            for quantity, word in zip(QUANTITIES, ("flow", "power"), strict=True)
        },
        y_label="%",
    )
    (folder / "real-station-parts.svg").write_text(chart + "\n", encoding="utf-8")
    fitted = comparisons["fitted"]
    lines = []
    for name in ("1.1", "2.2", "2.3", "2.4"):
        i = fitted.names.index(name)
        told, measured = fitted.told["flow_m3h"][i], fitted.measured["flow_m3h"][i]
        usable = fitted.is_steady[i] & (measured > 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(usable, 100.0 * (measured / told - 1.0), np.nan)
        lines.append(Series(f"pump {name}", second.time_ns, share))
    chart = line_chart(
        "Measured flow over that of the calibrated station, steady rows of the second week",
        lines,
        y_label="%",
        is_time=True,
        limits={"as calibrated": 0.0},
    )
    (folder / "real-station-second-week.svg").write_text(chart + "\n", encoding="utf-8")


def measured(workbook: Path, room: Path, plots: Path | None, *, with_diagnosis: bool) -> dict[str, Any]:
    """All figures."""
    station = load_station(HERE / "station.toml")
    converted = convert_files([workbook], HERE / "mapping.toml", room / "rows.parquet", station)
    rows = read_recording(room / "rows.parquet")
    cut_ns = from_iso(SECOND_BEGINS)
    weeks = {
        "first": between(rows, int(rows.time_ns[0]), cut_ns),
        "second": between(rows, cut_ns, int(rows.time_ns[-1]) + 1),
    }
    begin_s = time.process_time()
    estimates = calibrate(weeks["first"], station)
    seconds = time.process_time() - begin_s
    fitted = with_estimates(station, estimates)
    afterwards = with_estimates(station, calibrate(weeks["second"], station))
    comparisons = {"datasheets": compare(weeks["second"], station), "fitted": compare(weeks["second"], fitted)}
    parts = {
        "datasheets": figures(comparisons["datasheets"]),
        **{
            f"without {name}": figures(compare(weeks["second"], with_estimates(station, without(estimates, keys))))
            for name, keys in PARTS.items()
        },
        "calibrated": figures(comparisons["fitted"]),
        "fitted to it": figures(compare(weeks["second"], afterwards)),
    }
    if plots is not None:
        pictures(plots, comparisons, weeks["second"], parts)
    result: dict[str, Any] = {
        "version": importlib.metadata.version("wetwell"),
        "rows": converted["rows"] if "rows" in converted else len(rows),
        "weeks": {
            name: [to_iso(int(week.time_ns[0])), to_iso(int(week.time_ns[-1])), len(week)]
            for name, week in weeks.items()
        },
        "calibration_seconds": round(seconds, 2),
        "estimates": [
            {
                "name": one.name,
                "value": float(f"{one.value:.4g}"),
                "interval": None if one.interval is None else [float(f"{end:.4g}") for end in one.interval],
                "unit": one.unit,
                "reason": one.reason,
            }
            for one in estimates
        ],
        "first_week": {
            "datasheets": figures(compare(weeks["first"], station)),
            "calibrated": figures(compare(weeks["first"], fitted)),
        },
        "second_week": parts,
        "lost_in_runs": {name: lost_in_runs(compare(week, fitted)) for name, week in weeks.items()},
        "low_runs_of_29_november": low_runs(weeks["second"], comparisons["fitted"]),
        "detector": judged(fitted, rows, room),
    }
    if with_diagnosis:
        result["diagnosis"] = {
            "datasheets": diagnosed(station, weeks),
            "calibrated": diagnosed(fitted, weeks),
        }
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--plots", type=Path)
    parser.add_argument("--diagnose", action="store_true")
    arguments = parser.parse_args()
    workbook = arguments.folder / WORKBOOK
    if not workbook.is_file():
        sys.exit(f"{workbook}: not there, nothing is measured")
    with tempfile.TemporaryDirectory(prefix="real-station-") as room:
        result = measured(workbook, Path(room), arguments.plots, with_diagnosis=arguments.diagnose)
    print(json.dumps(result, indent=2, ensure_ascii=False))


if __name__ == "__main__":
    main()
