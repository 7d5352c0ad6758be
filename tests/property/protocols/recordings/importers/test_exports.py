"""Any recording, written as other systems write it, comes back within its rounding."""

import csv
import datetime as dt
import gzip
import io
import tempfile
from dataclasses import dataclass
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from hypothesis import given, settings
from hypothesis import strategies as st
from workbook import write_workbook

from wetwell.protocols.recordings.importers.conversion import convert
from wetwell.protocols.recordings.importers.mapping import TagMapping
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S, from_iso
from wetwell.protocols.units import factor, house_unit

UNITS = {
    "level_m": ["m", "cm", "mm", "ft", "kPa", "mbar"],
    "inflow_m3h": ["m³/h", "l/s", "m³/d", "L/min"],
    "pump1_flow_m3h": ["m3/h", "L/s", "m³/d", "gpm", "ML/d"],
    "pump1_head_m": ["m", "bar", "kPa", "psi"],
    "pump1_frequency_hz": ["Hz", "%"],
    "pump2_power_kw": ["kW", "W", "hp"],
    "pump2_running": [""],
}
TAGS = {
    "level_m": "PS07.LT01 Füllstand",
    "inflow_m3h": "PS07 Zulauf",
    "pump1_flow_m3h": "P1 débit; aval",
    "pump1_head_m": "P1 paine, mitattu",
    "pump1_frequency_hz": 'P1 "speed"',
    "pump2_power_kw": "P2.JT",
    "pump2_running": "P2 käy",
}
SPAN_HZ = (5.0, 55.0)
MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"]  # whatever the locale
FORMATS = {
    "%Y-%m-%d %H:%M:%S": lambda t: f"{t:%Y-%m-%d %H:%M:%S}",
    "iso": lambda t: t.replace(tzinfo=None).isoformat(),
    "%d.%m.%Y %H:%M:%S": lambda t: f"{t:%d.%m.%Y %H:%M:%S}",
    "%d.%m.%Y %H.%M.%S": lambda t: f"{t.day}.{t.month}.{t.year} {t.hour}.{t:%M.%S}",
    "%m/%d/%Y %I:%M:%S %p": lambda t: f"{t.month}/{t.day}/{t.year} {t:%I:%M:%S %p}",
    "%d-%b-%y %H:%M:%S": lambda t: f"{t:%d}-{MONTHS[t.month - 1]}-{t:%y %H:%M:%S}",
    "%Y%m%d%H%M%S": lambda t: f"{t:%Y%m%d%H%M%S}",
}
CHANGES = {
    "Europe/Helsinki": ("2024-10-27T01:00:00Z", "2025-03-30T01:00:00Z"),
    "America/New_York": ("2024-11-03T06:00:00Z", "2025-03-09T07:00:00Z"),
    "UTC": ("2024-10-27T01:00:00Z",),
}


@dataclass(frozen=True, kw_only=True)
class Style:
    """How a system writes its exports."""

    layout: str
    kind: str
    encoding: str
    delimiter: str
    decimal: str
    zone: str
    form: str
    has_offset: bool
    has_quality: bool
    has_titles: bool
    on_change: bool
    backward: bool
    files: int
    digits: int
    units: dict[str, str]


@st.composite
def recordings(draw):
    """A station on the days when the clocks change, on the hour of the change and around it."""
    zone = draw(st.sampled_from(sorted(CHANGES)))
    step_s = draw(st.sampled_from([300, 900, 1800, 3600]))
    change_s = from_iso(draw(st.sampled_from(CHANGES[zone]))) // NS_PER_S
    rows = 6 * 3600 // step_s
    names = draw(st.lists(st.sampled_from(sorted(UNITS)), min_size=2, unique=True))
    names = names if any(name.startswith("pump") for name in names) else [*names, "pump1_flow_m3h"]
    numbers = st.floats(0, 900, allow_nan=False).map(lambda value: round(value, 3)) | st.just(np.nan)
    columns = {}
    for name in names:
        values = st.sampled_from([0.0, 1.0]) if name.endswith("_running") else numbers
        drawn = draw(st.lists(values, min_size=3, max_size=7))
        columns[name] = np.array([drawn[(row // 3) % len(drawn)] for row in range(rows)])
    time_ns = NS_PER_S * (change_s - 3 * 3600 + step_s * np.arange(rows))
    return zone, Recording(time_ns=time_ns, columns=columns)


@st.composite
def styles(draw, zone, names):
    kind = draw(st.sampled_from(["csv", "csv", "csv.gz", "xlsx", "parquet"]))
    delimiter = draw(st.sampled_from([";", ",", "\t", "|"]))
    form = draw(st.sampled_from(sorted(FORMATS) if kind != "parquet" else ["%Y-%m-%d %H:%M:%S"]))
    on_change = draw(st.booleans())
    has_offset = kind != "xlsx" and (on_change or draw(st.booleans()))
    return Style(
        layout=draw(st.sampled_from(["long", "wide"])),
        kind=kind,
        encoding=draw(st.sampled_from(["utf-8", "utf-8-sig", "iso-8859-1", "utf-16", "cp1252"])),
        delimiter=delimiter,
        decimal=draw(st.sampled_from([".", ","])),
        zone=zone,
        form=form,
        has_offset=has_offset,
        has_quality=draw(st.booleans()),
        has_titles=draw(st.booleans()),
        on_change=on_change and has_offset,
        backward=draw(st.booleans()) and not on_change,
        files=draw(st.integers(1, 2)) if has_offset else 1,
        digits=draw(st.integers(1, 4)),
        units={name: draw(st.sampled_from(UNITS[name])) for name in names},
    )


def raw_of(name, unit, value):
    """Number that an instrument in some unit tells."""
    if unit == "%":
        return 100.0 * (value - SPAN_HZ[0]) / (SPAN_HZ[1] - SPAN_HZ[0])
    return value / (factor(unit, house_unit(name)) if unit else 1.0)


def cell_of(name, value, style):
    if np.isnan(value):
        return ""
    if name.endswith("_running"):
        return "EIN" if value else "AUS"
    return f"{raw_of(name, style.units[name], value):.{style.digits}f}".replace(".", style.decimal)


def stamp_of(time_ns, style):
    moment = dt.datetime.fromtimestamp(int(time_ns) // NS_PER_S, dt.UTC).astimezone(ZoneInfo(style.zone))
    if style.kind == "xlsx" and style.form == "iso":
        return moment.replace(tzinfo=None)
    text = FORMATS[style.form](moment)
    return text + moment.strftime("%z").replace("+0000", "Z") if style.has_offset else text


def rows_of(recording, style):
    """Header and rows of an export."""
    is_stored = {name: np.ones(len(recording), dtype=bool) for name in recording.columns}
    if style.on_change:
        for name, values in recording.columns.items():
            is_stored[name][1:] = ~((values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1])))
    stamps = [stamp_of(time_ns, style) for time_ns in recording.time_ns]
    order = range(len(recording))[::-1] if style.backward else range(len(recording))
    if style.layout == "wide":
        header = ["Zeit", *(TAGS[name] for name in recording.columns)]
        quality = ["Q", *(f"Q {TAGS[name]}" for name in recording.columns)][1:] if style.has_quality else []
        return header + quality, [
            [stamps[row]]
            + [
                wide_cell(name, values[row], is_stored[name][row], style)
                for name, values in recording.columns.items()
            ]
            + ["GOOD"] * len(quality)
            for row in order
        ]
    rows = []
    for row in order:
        for name, values in recording.columns.items():
            if is_stored[name][row]:
                is_bad = style.has_quality and np.isnan(values[row])
                cell = f"7{style.decimal}5" if is_bad else cell_of(name, values[row], style)
                rows.append(
                    [stamps[row], TAGS[name], cell, *(["Bad" if is_bad else "Good"] if style.has_quality else [])]
                )
        if style.has_titles:
            rows.append([stamps[row], "of no use", "1", *(["Good"] if style.has_quality else [])])
    return ["Zeit", "Tag", "Wert", *(["Güte"] if style.has_quality else [])], rows


def wide_cell(name, value, is_stored, style):
    """An empty cell of a wide table stored on change says that nothing has changed, so that no value needs a word."""
    if not is_stored:
        return ""
    return "keine" if style.on_change and np.isnan(value) else cell_of(name, value, style)


def write_export(path, header, rows, style):
    if style.kind == "xlsx":
        return write_workbook(path, [*([["Bericht"], []] if style.has_titles else []), header, *rows])
    if style.kind == "parquet":
        columns = list(zip(*rows, strict=True)) or [[]] * len(header)
        return pa.parquet.write_table(pa.table({n: list(c) for n, c in zip(header, columns, strict=True)}), path)
    text = io.StringIO()
    writer = csv.writer(text, delimiter=style.delimiter, lineterminator="\r\n")
    if style.has_titles:
        text.write("Bericht über Pumpwerk 7\r\n\r\n")
    writer.writerows([header, *rows])
    raw = text.getvalue().encode(style.encoding)
    path.write_bytes(gzip.compress(raw) if style.kind == "csv.gz" else raw)
    return None


def mapping_of(recording, style, step_s):
    signals = {}
    for name in recording.columns:
        signal = {"tag": TAGS[name], "unit": style.units[name]}
        if style.units[name] == "%":
            signal["span"] = SPAN_HZ
        if name.endswith("_running"):
            signal |= {"true": ["ein"], "false": ["AUS"]}
        if style.layout == "wide":
            signal |= {"no_value": ["keine"]} | ({"quality": f"Q {TAGS[name]}"} if style.has_quality else {})
        signals[name] = signal
    columns = {"time": "Zeit"}
    if style.layout == "long":
        columns |= {"tag": "Tag", "value": "Wert"} | ({"quality": "Güte"} if style.has_quality else {})
    good = {"good": ["good"]} if style.has_quality else {}
    held = {"value": "held", "step_s": step_s, "max_age_s": 1e6} if style.on_change else {}
    decimal = {"decimal": style.decimal}
    zone = {} if style.has_offset else {"time_zone": style.zone}
    return TagMapping.model_validate(
        {"station": "north", "layout": style.layout, "columns": columns | good, "signal": signals}
        | held
        | decimal
        | zone
    )


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_a_recording_comes_back_within_its_rounding(data):
    zone, recording = data.draw(recordings())
    style = data.draw(styles(zone, list(recording.columns)))
    step_s = int(recording.time_ns[1] - recording.time_ns[0]) // NS_PER_S
    header, rows = rows_of(recording, style)
    with tempfile.TemporaryDirectory() as folder:
        cut = len(rows) // 2 if style.files == 2 else len(rows)
        paths = [Path(folder, f"day{number}.{style.kind}") for number in range(style.files)]
        for path, part in zip(paths, (rows[:cut], rows[cut:]), strict=False):
            write_export(path, header, part, style)
        done = convert(paths, mapping_of(recording, style, step_s))
    back = done.recording
    assert not done.refused
    assert not done.undecided
    assert back.station == "north"
    last = len(back)
    assert back.time_ns.tolist() == recording.time_ns[:last].tolist()
    assert style.on_change or last == len(recording)
    for name, values in recording.columns.items():
        unit = style.units[name]
        size = (SPAN_HZ[1] - SPAN_HZ[0]) / 100.0 if unit == "%" else factor(unit, house_unit(name)) if unit else 1.0
        rounding = 0.5001 * size * 10.0**-style.digits + 1e-9
        np.testing.assert_allclose(back.columns[name], values[:last], rtol=1e-12, atol=rounding)
