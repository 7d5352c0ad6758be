"""Speed and memory of the conversion of exports: one JSON object on standard output.

    python benchmarks/convert.py

A million rows in each of some styles, each converted in a process of its own by the command line, from the export to
the written recording. Where pandas is installed, it reads the same text, stamps and zone included, without units,
quality or any account of what was left out. Seconds are given on the wall and as the processor counts them.
"""

import argparse
import importlib.metadata
import importlib.util
import json
import multiprocessing
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

SEED = 1
MOST_S, MOST_MB = 10.0, 500.0
"""Aims for a million rows."""
MAPPING = """station = "north"
layout = "{layout}"
time_zone = "Europe/Berlin"
{value}
[columns]
time = "time"
{columns}
[signal.level_m]
tag = "LT01"
unit = "cm"
[signal.pump1_flow_m3h]
tag = "P1.FT"
unit = "l/s"
[signal.pump1_frequency_hz]
tag = "P1.SPEED"
unit = "%"
span = [0.0, 50.0]
[signal.pump1_power_kw]
tag = "P1.KW"
[signal.pump1_running]
tag = "P1.RUN"
true = ["EIN"]
"""
LONG = 'tag = "tag"\nvalue = "value"\nquality = "quality"\ngood = ["GOOD"]'
TAGS = ("LT01", "P1.FT", "P1.SPEED", "P1.KW", "P1.RUN")
PANDAS = {
    "long": "t = pd.read_csv(sys.argv[1], sep=';', dtype=str)\n"
    "t['time'] = pd.to_datetime(t.time, format='%d.%m.%Y %H:%M:%S').dt.tz_localize('Europe/Berlin', ambiguous=True)\n"
    "t['value'] = pd.to_numeric(t.value.str.replace(',', '.'), errors='coerce')\n"
    "w = t.pivot_table(index='time', columns='tag', values='value')\n"
    "w.to_parquet(sys.argv[2])",
    "wide": "t = pd.read_csv(sys.argv[1], sep=';', decimal=',')\n"
    "t['time'] = pd.to_datetime(t.time, format='%d.%m.%Y %H:%M:%S').dt.tz_localize('Europe/Berlin', ambiguous=True)\n"
    "t.to_parquet(sys.argv[2])",
}


def stamps(rows: int) -> list[str]:
    """Local stamps, one in 5 s, away from the nights in which the clocks change."""
    moments = np.datetime64("2024-04-02T00:00:00") + 5 * np.arange(rows)
    days = np.unique(moments.astype("datetime64[D]"), return_inverse=True)
    dates = np.array([f"{day.astype(object):%d.%m.%Y} " for day in days[0]])
    clock = np.char.partition(np.datetime_as_string(moments, unit="s"), "T")[:, 2]
    return list(np.char.add(dates[days[1]], clock))


def table(layout: str, rows: int) -> pa.Table:
    """Export of so many rows as texts with decimal comma."""
    rng = np.random.default_rng(SEED)
    moments = rows // len(TAGS) if layout == "long" else rows
    texts = {
        tag: np.char.replace(np.char.mod("%.3f", 100.0 + rng.normal(size=moments)), ".", ",").tolist()
        for tag in TAGS[:-1]
    }
    texts["P1.RUN"] = np.where(rng.random(moments) < 0.5, "EIN", "AUS").tolist()
    if layout == "wide":
        return pa.table({"time": stamps(moments), **texts})
    return pa.table(
        {
            "time": np.repeat(stamps(moments), len(TAGS)).tolist(),
            "tag": list(TAGS) * moments,
            "value": [text for row in zip(*texts.values(), strict=True) for text in row],
            "quality": ["GOOD"] * (moments * len(TAGS)),
        }
    )


def measured(command: list[str]) -> dict[str, object]:
    """Seconds and peak of memory of a command."""
    began_s = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)  # noqa: S603 - our own command
    _, status, used = os.wait4(child.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command[:6])}: failed")
    return {
        "wall_s": round(time.perf_counter() - began_s, 2),
        "processor_s": round(used.ru_utime + used.ru_stime, 2),
        "peak_mb": round(used.ru_maxrss / 1024.0, 1),
    }


def write_export(layout: str, rows: int, export: Path) -> None:
    """Write an export; in a process of its own, as a child inherits the peak of its parent's memory."""
    content = table(layout, rows)
    if export.suffix == ".parquet":
        pa.parquet.write_table(content, export)
    else:
        pa.csv.write_csv(content, export, pa.csv.WriteOptions(delimiter=";", quoting_style="none"))


def converted(room: Path, name: str, rows: int) -> dict[str, object]:
    """Figures of one style, beside those of pandas."""
    layout = "wide" if name.startswith("wide") else "long"
    export = room / f"{name}.{'parquet' if name.endswith('parquet') else 'csv'}"
    writer = multiprocessing.get_context("spawn").Process(target=write_export, args=(layout, rows, export))
    writer.start()
    writer.join()
    held = 'value = "held"\nmax_age_s = 600.0' if name == "long, held" else ""
    mapping, out = room / "mapping.toml", room / "out.parquet"
    mapping.write_text(
        MAPPING.format(layout=layout, value=held, columns=LONG if layout == "long" else ""), encoding="utf-8"
    )
    command = [sys.executable, "-m", "wetwell.services", "convert", str(export), "--mapping", str(mapping)]
    figures = measured([*command, "--out", str(out)])
    figures |= {
        "export": name,
        "mb": round(export.stat().st_size / 1e6, 1),
        "rows_s": round(rows / float(str(figures["wall_s"]))),
    }
    if export.suffix == ".csv" and importlib.util.find_spec("pandas"):
        script = f"import sys\nimport pandas as pd\n{PANDAS[layout]}"
        figures["pandas"] = measured([sys.executable, "-c", script, str(export), str(out)])
    return figures


def main() -> None:
    """Convert all styles, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    rows = parser.parse_args().rows
    with tempfile.TemporaryDirectory(prefix="convert-") as room:
        exports = [converted(Path(room), name, rows) for name in ("long", "long, held", "wide", "wide, parquet")]
    result = {
        "benchmark": "convert",
        "version": importlib.metadata.version("wetwell"),
        "python": platform.python_version(),
        "machine": platform.platform(),
        "cores": os.cpu_count(),
        "seed": SEED,
        "rows": rows,
        "aims": {"wall_s": MOST_S, "peak_mb": MOST_MB},
        "exports": exports,
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
