"""Drafts of mappings: which names are recognised, and that a draft is a mapping once the zone is said."""

import pytest

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.importers.conversion import convert
from wetwell.protocols.recordings.importers.draft.draft import draft_of
from wetwell.protocols.recordings.importers.draft.tag_names import recognise
from wetwell.protocols.recordings.importers.draft.unit_names import unit_in, unit_of
from wetwell.protocols.recordings.importers.mapping import load_mapping


@pytest.mark.parametrize(
    ("tag", "quantity", "pump"),
    [
        ("PS07.LT01.PV", "level_m", ""),
        ("Wet Well Level", "level_m", ""),
        ("Füllstand Pumpensumpf", "level_m", ""),
        ("JVP7 Pinnankorkeus", "level_m", ""),
        ("Hauteur bâche", "level_m", ""),
        ("Zulaufmenge", "inflow_m3h", ""),
        ("STATION_INFLOW", "inflow_m3h", ""),
        ("Pumpe 1 Durchfluss", "flow_m3h", "1"),
        ("Débit pompe 2", "flow_m3h", "2"),
        ("P1 virtaama", "flow_m3h", "1"),
        ("\\\\PISRV\\PS07.P-102.FT", "flow_m3h", "102"),
        ("Pump1Speed", "frequency_hz", "1"),
        ("P2_Drehzahl", "frequency_hz", "2"),
        ("P01 taajuus", "frequency_hz", "1"),
        ("Pump 3 Power kW", "power_kw", "3"),
        ("P1_Leistung", "power_kw", "1"),
        ("Pumppu 2 teho", "power_kw", "2"),
        ("P1 discharge pressure", "head_m", "1"),
        ("Pump 1 head", "head_m", "1"),
        ("P1.PT", "head_m", "1"),
        ("P1_Betrieb", "running", "1"),
        ("Pompe 1 marche", "running", "1"),
        ("pump2_running", "running", "2"),
    ],
)
def test_tags_that_are_recognised(tag, quantity, pump):
    guess = recognise(tag, unit_in(tag))
    assert guess is not None
    assert (guess.quantity, guess.pump) == (quantity, pump)


@pytest.mark.parametrize(
    "tag",
    [
        "P1 Betriebsstunden",
        "LT01.SP",
        "Level alarm high",
        "Total flow",
        "P1 current [A]",
        "Rain",
        "TT01",
        "Energiezähler",
    ],
)
def test_tags_that_are_left_alone(tag):
    assert recognise(tag, unit_in(tag)) is None


@pytest.mark.parametrize(
    ("text", "unit", "scale"),
    [
        ("m³/h", "m³/h", 1.0),
        ("m^3/hr", "m³/h", 1.0),
        ("l/s", "l/s", 1.0),
        ("LPS", "l/s", 1.0),
        ("m3/d", "m³/d", 1.0),
        ("MGD", "ML/d", 3.785411784),
        ("m3/15 min", "m³/h", 4.0),
        ("mWS", "m", 1.0),
        ("kW", "kW", 1.0),
        ("%", "%", 1.0),
    ],
)
def test_units_that_are_recognised(text, unit, scale):
    guess = unit_of(text)
    assert guess is not None
    assert (guess.unit, guess.scale) == (unit, scale)


WIDE = """Bericht Pumpwerk 7;;;;;
Zeit;Füllstand;P1 Durchfluss;P1 Drehzahl;P1 Betrieb;P1 Strom
;cm;l/s;%;;A
15.11.2024 12:00:00;120,5;40,1;90,0;EIN;12
15.11.2024 12:01:00;121,5;40,2;90,0;EIN;12
15.11.2024 12:02:00;122,5;0,0;0,0;AUS;0
"""
LONG = "t_stamp,TagPath,Value,Quality\n" + "".join(
    f"2024-11-15T12:{minute:02}:00+02:00,Sites/PS07/{tag},{value},{quality}\n"
    for minute in range(10)
    for tag, value, quality in (("LIT-101", 1.5 + minute / 10, "Good"), ("P1_FIT", 100, "Good"), ("P1_RUN", 1, "Bad"))
)


def drafted(tmp_path, text, zone=""):
    """Mapping of a draft in which a person has said the zone, and the recording that it makes."""
    export, mapping = tmp_path / "ps07 2024.csv", tmp_path / "mapping.toml"
    export.write_text(text, encoding="cp1252")
    draft = draft_of([export])
    mapping.write_text(draft.text.replace('# time_zone = "Europe/Helsinki"', zone), encoding="utf-8")
    return draft, convert([export], load_mapping(mapping))


def test_a_draft_of_a_wide_file_is_a_mapping(tmp_path):
    draft, done = drafted(tmp_path, WIDE, 'time_zone = "Europe/Berlin"')
    columns = {name: values.tolist() for name, values in done.recording.columns.items()}
    assert columns["level_m"] == pytest.approx([1.205, 1.215, 1.225])
    assert columns["pump1_flow_m3h"] == pytest.approx([144.36, 144.72, 0.0])
    assert columns["pump1_frequency_hz"] == [45.0, 45.0, 0.0]
    assert columns["pump1_running"] == [1.0, 1.0, 0.0]
    assert draft.unmapped == ["P1 Strom"]
    assert draft.assumed["time_zone"].startswith("missing")
    assert 'station = "ps07-2024"  # assumed: the name of the file' in draft.text
    assert "# a tag is stored every 60 s" in draft.text
    assert '# not used: "P1 Strom": unit A' in draft.text


def test_a_draft_of_a_long_file_is_a_mapping(tmp_path):
    draft, done = drafted(tmp_path, LONG)
    assert done.recording.columns["level_m"].tolist() == pytest.approx([1.5 + minute / 10 for minute in range(10)])
    assert done.bad_quality == {"pump1_running": 10}
    assert "time_zone: not needed" in draft.text
    assert "good = [\"Good\"]  # assumed; there is also 'Bad'" in draft.text


def test_uneven_stamps_are_values_stored_on_change(tmp_path):
    seconds = [0, 3, 11, 60, 62, 180, 181, 300, 555, 580]
    text = "Time;Tag;Value\n" + "".join(
        f"2024-11-15 12:{second // 60:02}:{second % 60:02};{tag};{second}\n"
        for second in seconds
        for tag in ("LT1", "P1_FT")
    )
    draft, _ = drafted(tmp_path, text, 'time_zone = "UTC"')
    assert 'value = "held"  # assumed' in draft.text
    assert "max_age_s = 255.0  # assumed: the longest silence of a tag" in draft.text


def test_a_tag_that_is_silent_while_others_are_not_is_stored_on_change(tmp_path):
    text = "Time;Tag;Value\n" + "".join(
        f"2024-11-15 12:{second // 60:02}:{second % 60:02};{tag};{second}\n"
        for second in range(0, 900, 10)
        for tag in ("LT1", "P1_FT")
        if tag == "LT1" or second % 300 < 100 or second == 890
    )
    draft, _ = drafted(tmp_path, text, 'time_zone = "UTC"')
    assert 'value = "held"  # assumed' in draft.text


def test_a_title_may_hold_the_delimiter(tmp_path):
    draft, done = drafted(tmp_path, "Trend report; PS07;;\n" + LONG)
    assert done.recording.columns["level_m"].size == 10
    assert draft.assumed["lines"] == "header 2, first row 3"


@pytest.mark.parametrize(("form", "per_s"), [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
def test_seconds_since_1970_are_recognised_under_any_name(tmp_path, form, per_s):
    begin_s = 1_729_965_600
    rows = "".join(f"{(begin_s + 10 * row) * per_s},{row / 10},{row}\n" for row in range(20))
    draft, done = drafted(tmp_path, f"ts,level,P1 flow\n{rows}")
    assert draft.assumed["time_format"] == f"'epoch_{form}'"
    assert "time_zone: not needed" in draft.text
    assert (done.recording.time_ns // 10**9).tolist() == [begin_s + 10 * row for row in range(20)]


@pytest.mark.parametrize(("of_start", "value"), [(40.0, "mean"), (100.0, "instant")])
def test_rows_of_starts_tell_means_from_instants(tmp_path, of_start, value):
    flows = [0.0, 0.0, of_start, 100.0, 100.0] * 12
    rows = "".join(f"2024-11-15 {12 + row // 60}:{row % 60:02};1.5;{flow}\n" for row, flow in enumerate(flows))
    draft, _ = drafted(tmp_path, f"Time;Level;P1 flow\n{rows}", 'time_zone = "UTC"')
    assert f'value = "{value}"  # assumed' in draft.text


def test_day_and_month_that_cannot_be_told_apart_are_said(tmp_path):
    draft, _ = drafted(
        tmp_path, "Time;Level;P1 flow\n01/02/2024 12:00;1;2\n01/02/2024 12:10;1;2\n", 'time_zone = "UTC"'
    )
    assert 'time_format = "%d/%m/%Y %H:%M"  # assumed from the stamps; or is it %m/%d/%Y %H:%M?' in draft.text


def test_a_file_without_times_is_refused(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("a;b\n1;2\n3;4\n")
    with pytest.raises(RecordingError, match="no column with times was found among 'a', 'b'"):
        draft_of([path])
