"""Exports as systems write them: what is made of them, what is told, and what is refused in one line."""

import datetime as dt
import re
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from workbook import write_workbook

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.recordings.importers import conversion
from wetwell.protocols.recordings.importers.conversion import convert
from wetwell.protocols.recordings.importers.mapping import load_mapping
from wetwell.protocols.timestamps import from_iso, to_iso

LONG = """
station = "north"
layout = "long"
time_zone = "Europe/Helsinki"
{top}
[columns]
time = "timestamp"
tag = "tag"
value = "value"
{columns}
[signal.level_m]
tag = "LT1"
unit = "cm"
{level}
[signal.pump1_running]
tag = "P1"
true = ["EIN"]
{pump}
"""
WIDE = """
station = "north"
layout = "wide"
time_zone = "Europe/Helsinki"
{top}
[columns]
time = "Zeit"
{columns}
[signal.level_m]
tag = "LT1"
{level}
[signal.pump1_flow_m3h]
tag = "FT1"
{pump}
"""


class Bench:
    """Writes exports and mappings, and converts them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, name: str, content: str | bytes) -> Path:
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def mapping(self, text: str = LONG, **parts: str):
        filled = text.format(**({"top": "", "columns": "", "level": "", "pump": ""} | parts))
        return load_mapping(self.file("mapping.toml", filled))

    def convert(self, content: str | bytes, text: str = LONG, **parts: str):
        return convert([self.file("export.csv", content)], self.mapping(text, **parts))


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


def long_rows(*rows: str) -> str:
    return "timestamp;tag;value;quality\n" + "".join(f"{row}\n" for row in rows)


def both(*stamps: str) -> str:
    """Long file in which both tags have a value at each stamp."""
    return long_rows(*(f"{stamp};{cell};GOOD" for stamp in stamps for cell in ("LT1;1", "P1;EIN")))


def iso(recording) -> list[str]:
    return [to_iso(stamp) for stamp in recording.time_ns.tolist()]


def test_tags_of_a_long_file_become_rows(bench):
    done = bench.convert(
        long_rows(
            "15.11.2024 12:00:00;LT1;120,5;GOOD",
            "15.11.2024 12:00:00;P1;EIN;GOOD",
            "15.11.2024 12:00:10;LT1;121;GOOD",
            "15.11.2024 12:00:10;P1;AUS;GOOD",
            "15.11.2024 12:00:10;TT1;8;GOOD",
        )
    )
    assert iso(done.recording) == ["2024-11-15T10:00:00Z", "2024-11-15T10:00:10Z"]
    assert done.recording.columns["level_m"].tolist() == [1.205, 1.21]
    assert done.recording.columns["pump1_running"].tolist() == [1.0, 0.0]
    assert done.unmapped == {"TT1": 1}
    assert done.assumed == {
        "encoding": "utf-8",
        "delimiter": "';'",
        "decimal": "','",
        "time_format": "'%d.%m.%Y %H:%M:%S'",
        "pump1_running 'AUS'": "stands",
    }
    assert done.recording.station == "north"


FROM_THE_FLAG = '[signal.pump1_frequency_hz]\ntag = "{tag}"\nscale = 50\n'


def test_a_run_flag_of_numbers_can_stand_for_the_frequency_too(bench):
    flag = '[signal.pump1_running]\ntag = "B1"\n'
    text = WIDE + flag + FROM_THE_FLAG.format(tag="B1")
    wide = "Zeit;LT1;FT1;B1\n15.11.2024 12:00:00;1,2;90;1\n15.11.2024 12:00:10;1,3;0;0\n"
    rows = ("2024-11-15 12:00:00;P1;1;GOOD", "2024-11-15 12:00:10;P1;0;GOOD", "2024-11-15 12:00:10;LT1;9;GOOD")
    numbers = LONG.replace('true = ["EIN"]', "") + FROM_THE_FLAG.format(tag="P1")
    for done in (bench.convert(wide, text), bench.convert(long_rows(*rows), numbers)):
        assert done.recording.columns["pump1_running"].tolist() == [1.0, 0.0]
        assert done.recording.columns["pump1_frequency_hz"].tolist() == [50.0, 0.0]
    with pytest.raises(ConfigError, match=r"signal\.pump1_frequency_hz\.true: is for pump1_running"):
        bench.mapping(text + 'true = ["EIN"]\n')


def test_stamps_that_differ_a_little_make_a_grid(bench):
    rows = [
        f"2024-11-15 12:{second // 60:02}:{second % 60:02}.{part};{tag};{value};GOOD"
        for second in range(0, 600, 10)
        for part, tag, value in (("120", "LT1", second), ("480", "P1", "EIN"))
    ]
    done = bench.convert(long_rows(*rows))
    assert done.assumed["step_s"] == "10, as the stamps of the tags do not coincide"
    assert np.diff(done.recording.time_ns).tolist() == [10_000_000_000] * 59
    assert done.recording.columns["level_m"].tolist() == pytest.approx([second / 100 for second in range(0, 600, 10)])


def test_a_value_stored_on_change_holds_until_it_is_too_old(bench):
    done = bench.convert(
        long_rows(
            "2024-11-15 12:00:00;LT1;100;GOOD",
            "2024-11-15 12:00:00;P1;EIN;GOOD",
            "2024-11-15 12:00:20;LT1;;GOOD",
            "2024-11-15 12:00:50;LT1;110;GOOD",
            "2024-11-15 12:01:40;P1;AUS;GOOD",
        ),
        top='value = "held"\nstep_s = 10.0\nmax_age_s = 30.0',
        pump="max_age_s = 600.0",
    )
    assert done.recording.value == "held"
    nan = np.nan
    level_m = [1.0, 1.0, nan, nan, nan, 1.1, 1.1, 1.1, 1.1, nan, nan]
    np.testing.assert_array_equal(done.recording.columns["level_m"], level_m)
    assert done.recording.columns["pump1_running"].tolist() == [1.0] * 10 + [0.0]


def test_a_value_of_bad_quality_is_none(bench):
    done = bench.convert(
        long_rows("2024-11-15 12:00;LT1;120;GOOD", "2024-11-15 12:10;LT1;999;Bad", "2024-11-15 12:10;P1;EIN;good"),
        columns='quality = "quality"\ngood = ["GOOD"]',
    )
    np.testing.assert_array_equal(done.recording.columns["level_m"], [1.2, np.nan])
    assert done.bad_quality == {"level_m": 1}


def test_what_cannot_be_read_is_counted_and_the_first_is_shown(bench):
    done = bench.convert(
        long_rows(
            "2024-11-15 12:00;LT1;120;GOOD",
            "2024-11-15 25:00;LT1;121;GOOD",
            "yesterday;LT1;122;GOOD",
            "2024-11-15 12:01;LT1;Bad Input;GOOD",
            ";;;",
            "2024-11-15 12:02;P1;EIN;GOOD",
            "2024-11-15 12:03;P1;EIN",
            "*** end of report ***",
        )
    )
    path = bench.folder / "export.csv"
    assert done.refused == [
        {"rows": 2, "why": "time is not %Y-%m-%d %H:%M", "first": f"{path}, line 3: '2024-11-15 25:00'"},
        {"rows": 1, "why": "'LT1' is no number", "first": f"{path}, line 5: 'Bad Input'"},
        {"rows": 2, "why": "another number of columns", "first": f"{path}, line 8: '2024-11-15 12:03;P1;EIN'"},
    ]


@pytest.mark.parametrize(
    ("zone", "before", "doubled", "after"),
    [
        ("Europe/Helsinki", "27.10.2024 02:{}", "27.10.2024 03:{}", "27.10.2024 04:{}"),
        ("America/New_York", "3.11.2024 00:{}", "3.11.2024 01:{}", "3.11.2024 02:{}"),
    ],
)
@pytest.mark.parametrize("minutes", [("00", "15", "30", "45"), ("00", "30"), ("00",)])
@pytest.mark.parametrize("backward", [False, True])
def test_the_hour_that_comes_twice(bench, zone, before, doubled, after, minutes, backward):
    stamps = [hour.format(minute) for hour in (before, doubled, doubled, after) for minute in minutes]
    path = bench.file("export.csv", both(*(stamps[::-1] if backward else stamps)))
    done = convert([path], bench.mapping().model_copy(update={"time_zone": zone}))
    steps_s = np.diff(done.recording.time_ns) / 1e9
    assert steps_s.tolist() == [3600 / len(minutes)] * (4 * len(minutes) - 1)
    assert done.undecided == 0


def test_the_doubled_hour_in_files_that_are_given_in_any_order(bench):
    second = bench.file("28.csv", both(*(f"28.10.2024 {hour:02}:00" for hour in range(24))))
    first = bench.file("27.csv", both("27.10.2024 02:30", *[f"27.10.2024 03:{m}" for m in ("00", "30")] * 2))
    done = convert([second, first], bench.mapping())
    assert iso(done.recording)[:5] == [
        f"2024-10-2{t}:00Z" for t in ("6T23:30", "7T00:00", "7T00:30", "7T01:00", "7T01:30")
    ]
    assert done.undecided == 0
    done = convert([first, first, second], bench.mapping())
    assert done.undecided == 16


def test_a_lonely_stamp_in_the_doubled_hour_is_the_first_and_is_told(bench):
    done = bench.convert(both("27.10.2024 02:50", "27.10.2024 03:30", "27.10.2024 05:00"))
    assert iso(done.recording)[1] == "2024-10-27T00:30:00Z"
    assert done.undecided == 2


def test_the_doubled_hour_goes_by_tag(bench):
    """Export sorted by tag, not by time."""
    stamps = ["27.10.2024 03:00", "27.10.2024 03:30", "27.10.2024 03:00", "27.10.2024 03:30"]
    done = bench.convert(long_rows(*(f"{t};{tag};1;G" for tag in ("LT1", "P1") for t in stamps)))
    assert iso(done.recording) == [f"2024-10-27T0{hour}:{minute}:00Z" for hour in (0, 1) for minute in ("00", "30")]


@pytest.mark.parametrize(
    ("zone", "stamp"), [("Europe/Helsinki", "30.3.2025 03:30"), ("America/New_York", "9.3.2025 02:30")]
)
def test_a_stamp_in_the_missing_hour_is_told(bench, zone, stamp):
    path = bench.file("export.csv", both("28.2.2025 01:00", stamp, "31.3.2025 05:00"))
    done = convert([path], bench.mapping().model_copy(update={"time_zone": zone}))
    assert len(done.recording) == 2
    (refused,) = done.refused
    assert refused["why"] == "stamp in an hour that the clocks left out"
    assert refused["rows"] == 2
    assert refused["first"].startswith(f"{path}, line 4: '2025-03-")


def test_an_offset_in_the_stamp_wins(bench):
    done = bench.convert(both("2024-10-27T03:30:00+03:00", "2024-10-27T03:30:00+02:00", "2024-10-27T12:00:00Z"))
    assert iso(done.recording) == ["2024-10-27T00:30:00Z", "2024-10-27T01:30:00Z", "2024-10-27T12:00:00Z"]


@pytest.mark.parametrize(
    ("stamp", "said"),
    [
        ("1731664800", ""),
        ("1731664800000", ""),
        ("1731664800,5", 'time_format = "epoch_s"'),
        ("45611,5", ""),
        ("15-Nov-24 12:00:00", ""),
        ("15. marras 2024 12.00", 'time_format = "%d. %b %Y %H.%M"'),
        ("11/15/2024 12:00:00 PM", ""),
        ("15/11/24 12:00", ""),
        ("20241115120000", ""),
        ("2024-11-15T12:00:00.000", ""),
    ],
)
def test_forms_of_stamps(bench, stamp, said):
    done = bench.convert(long_rows(f"{stamp};LT1;1;G", f"{stamp};P1;EIN;G"), top=said)
    (time_ns,) = done.recording.time_ns.tolist()
    assert time_ns // 10**9 == from_iso("2024-11-15T10:00:00Z") // 10**9


def test_date_and_time_of_day_in_two_columns(bench):
    done = bench.convert(
        "Datum;Zeit;LT1;FT1\n15.11.2024;12:00:00;1,5;20\n15.11.2024;12:00:10;1,6;21\n", WIDE, columns='date = "Datum"'
    )
    assert iso(done.recording) == ["2024-11-15T10:00:00Z", "2024-11-15T10:00:10Z"]


def test_files_of_a_day_each_and_of_a_tag_each_are_one_recording(bench):
    paths = [
        bench.file("b.csv", "Zeit;LT1\n2024-11-16 00:00;3\n2024-11-16 00:10;4\n"),
        bench.file("a.csv", "Zeit;LT1\n2024-11-15 23:40;1\n2024-11-15 23:50;2\n"),
        bench.file("c.csv", "Zeit,FT1\n2024-11-15 23:50,7.5\n2024-11-16 00:00,8.5\n"),
    ]
    done = convert(paths, bench.mapping(WIDE))
    assert done.recording.columns["level_m"].tolist() == [1.0, 2.0, 3.0, 4.0]
    np.testing.assert_array_equal(done.recording.columns["pump1_flow_m3h"], [np.nan, 7.5, 8.5, np.nan])
    assert done.assumed[f"{paths[2]}: delimiter"] == "','"


def test_title_unit_and_trailing_delimiters_are_no_rows(bench):
    titles = "Report;;;\nfrom 1.1.2024;;;\n\nZeit;LT1;FT1;\n;m;m³/h;\n"
    text = f"{titles}15.11.2024 12:00;1,5;1.234,5;\n15.11.2024 12:10;1,6;7;\n"
    done = bench.convert(text.encode("iso-8859-1"), WIDE)
    assert done.recording.columns["pump1_flow_m3h"].tolist() == [1234.5, 7.0]
    assert done.assumed["lines"] == "header 4, first row 6"
    assert not done.refused


def test_of_values_at_the_same_stamp_the_last_counts_and_it_is_told(bench):
    done = bench.convert("Zeit;LT1;FT1\n2024-11-15 12:00;1;\n2024-11-15 12:00;2;5\n2024-11-15 12:10;3;\n", WIDE)
    assert done.recording.columns["level_m"].tolist() == [2.0, 3.0]
    assert done.doubled == 1


def test_percent_of_a_span_and_of_the_nominal_frequency(bench):
    text = "Zeit;LT1;FT1;S1\n2024-11-15 12:00;50;10;90\n2024-11-15 12:10;100;20;100\n"
    level, drive = 'unit = "%"\nspan = [1.0, 5.0]', '[signal.pump1_frequency_hz]\ntag = "S1"\nunit = "%"'
    path, mapping = bench.file("export.csv", text), bench.mapping(WIDE, level=level, pump=drive)
    done = convert([path], mapping, [60.0])
    assert done.recording.columns["level_m"].tolist() == [3.0, 5.0]
    assert done.recording.columns["pump1_frequency_hz"].tolist() == [54.0, 60.0]
    with pytest.raises(
        ConfigError, match=r"signal\.pump1_frequency_hz: unit '%' is of the nominal frequency; give --station"
    ):
        convert([path], mapping)


def test_numbers_of_typed_parquet(bench):
    times = pa.array([0, 600], pa.timestamp("s", tz="Europe/Berlin"))
    table = pa.table(
        {"Zeit": times, "LT1": pa.array([1, None], pa.int32()), "FT1": pa.array([True, False]), "x": [1, 2]}
    )
    pa.parquet.write_table(table, bench.folder / "export.parquet")
    done = convert([bench.folder / "export.parquet"], bench.mapping(WIDE))
    assert iso(done.recording) == ["1970-01-01T00:00:00Z", "1970-01-01T00:10:00Z"]
    np.testing.assert_array_equal(done.recording.columns["level_m"], [1.0, np.nan])
    assert done.recording.columns["pump1_flow_m3h"].tolist() == [1.0, 0.0]
    assert done.unmapped == {"x": None}


@pytest.mark.parametrize(
    ("content", "parts", "said"),
    [
        ("", {}, "no delimiter was found"),
        ("Zeit;LT1;FT1\n", {}, "no row could be read"),
        ("Zeit;LT1;FT1\nx;1;2\n", {}, "'x' in {path} is of no form that is known"),
        (
            "Datum;LT1;FT1\n2024-11-15 12:00;1;2\n",
            {},
            "columns.time: 'Zeit' is in no line at the top; there is 'Datum', ",
        ),
        (
            "Zeit;LT1;FT2\n2024-11-15 12:00;1;2\n",
            {},
            "signal.pump1_flow_m3h.tag: got 'FT1', the files have 'Zeit', 'LT1', ",
        ),
        ("Zeit;LT1;FT1\n01/02/2024 12:00;1;2\n", {}, "'01/02/2024 12:00' in {path} could be %d/%m/%Y %H:%M or %m/%d"),
        (
            "Zeit;LT1;FT1\n2024-11-15 12:00;1;2\n",
            {"zone": None},
            "time_zone: missing, the stamp of {path}, line 2, has no ",
        ),
        (
            "Zeit;LT1;FT1\n" + "2024-11-15 12:00;1;2\n" * 50 + "2024-11-15 12:00;1;2;3\n" * 50,
            {},
            "line 52 and 49 more have not the 3 columns of the header; if the columns change half way",
        ),
        (b"Zeit;LT1;FT1\n2024-11-15 12:00;1;\xe4\n", {"top": 'encoding = "utf-8"'}, "is not utf-8"),
        (
            "Zeit;LT1;FT1\n1970-01-01 12:00;1;2\n2024-11-15 12:00;1;2\n",
            {"top": "step_s = 1.0"},
            "step_s: 1 s makes 1731628801 rows",
        ),
    ],
)
def test_a_file_that_does_not_do_is_refused_in_one_line(bench, content, parts, said):
    path = bench.file("export.csv", content)
    mapping = bench.mapping(WIDE, **{name: part for name, part in parts.items() if name != "zone"})
    mapping = mapping.model_copy(update={"time_zone": parts.get("zone", "UTC")})
    with pytest.raises((ConfigError, RecordingError)) as caught:
        convert([path], mapping)
    assert said.format(path=path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_more_than_the_memory_is_refused_before_it_begins(bench, monkeypatch):
    monkeypatch.setattr(conversion.os, "sysconf", lambda _: 1)
    with pytest.raises(RecordingError, match=r"needs about .* GB of memory, this machine has .*: convert its days"):
        bench.convert("Zeit;LT1;FT1\n2024-11-15 12:00;1;2\n", WIDE)


@pytest.mark.parametrize("name", ["export.csv", "export.csv.gz", "export.xlsx", "export.parquet"])
def test_a_file_that_is_none_is_one_line(bench, name):
    with pytest.raises(RecordingError, match="cannot be read: No such file"):
        convert([bench.folder / "no" / name], bench.mapping(WIDE))
    path = bench.file(name, b"PK\x03\x04 this is no archive")
    with pytest.raises(RecordingError) as caught:
        convert([path], bench.mapping(WIDE))
    assert "\n" not in str(caught.value)


def test_a_workbook_with_times_texts_and_empty_cells(bench):
    """Midnight comes as a date alone, and a number that somebody typed as text has the comma of his country."""
    times = [dt.datetime(2024, 11, day, hour) for day, hour in ((15, 23), (16, 0), (16, 1))]  # noqa: DTZ001
    rows = [
        ["Report"],
        ["Zeit", "LT1", "FT1"],
        ["", "m", "m³/h"],
        [times[0], 1.5, 10],
        [times[1], "1,25", ""],
        [times[2], 2, 7.5],
    ]
    write_workbook(bench.folder / "export.xlsx", rows)
    done = convert([bench.folder / "export.xlsx"], bench.mapping(WIDE))
    assert iso(done.recording) == ["2024-11-15T21:00:00Z", "2024-11-15T22:00:00Z", "2024-11-15T23:00:00Z"]
    assert done.recording.columns["level_m"].tolist() == [1.5, 1.25, 2.0]
    np.testing.assert_array_equal(done.recording.columns["pump1_flow_m3h"], [10.0, np.nan, 7.5])
    with pytest.raises(RecordingError, match=r"sheet: got 'Tabelle2', there are Daten"):
        convert([bench.folder / "export.xlsx"], bench.mapping(WIDE, top='sheet = "Tabelle2"'))


def test_a_workbook_without_sheets_gives_one_line(bench):
    whole, empty = bench.folder / "whole.xlsx", bench.folder / "empty.xlsx"
    write_workbook(whole, [["Zeit", "LT1"], ["2024-11-15 23:00:00", 1.5]])
    with ZipFile(whole) as source, ZipFile(empty, "w") as target:
        for name in source.namelist():
            target.writestr(name, re.sub(rb"<sheet [^>]*>", b"", source.read(name)))
    with pytest.raises(RecordingError, match=r"empty\.xlsx: sheet: there is none"):
        convert([empty], bench.mapping(WIDE))
