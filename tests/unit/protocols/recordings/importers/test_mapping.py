"""Mappings: what is refused, in one line that names file, key, value and rule."""

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.recordings.importers.mapping import load_mapping

GOOD = """
station = "north"
layout = "long"
delimiter = ";"
decimal = ","
encoding = "utf-8"
time_zone = "Europe/Helsinki"
value = "instant"
[columns]
time = "timestamp"
tag = "tag"
value = "value"
quality = "status"
good = ["GOOD", "192"]
[signal.level_m]
tag = "PS07.LT01.PV"
unit = "cm"
offset = 0.0
[signal.pump1_frequency_hz]
tag = "PS07.P1.SPEED"
unit = "%"
[signal.pump1_running]
tag = "PS07.P1.STATE"
true = ["EIN", "1"]
"""


def written(tmp_path, text):
    path = tmp_path / "mapping.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_mapping_of_the_specification(tmp_path):
    mapping = load_mapping(written(tmp_path, GOOD))
    assert mapping.signal["level_m"].unit == "cm"
    assert mapping.columns.good == ("GOOD", "192")
    assert mapping.max_age_s is None


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"cm"', '"furlong"', "signal.level_m.unit: got 'furlong', must be one of m, cm, mm, "),
        ("Europe/Helsinki", "Europe/Helsingfors", "time_zone: got 'Europe/Helsingfors', must be a time zone such as"),
        ('"utf-8"', '"utf-9"', "encoding: got 'utf-9', must be an encoding such as utf-8"),
        (
            "[signal.level_m]",
            "[signal.niveau]",
            "signal.niveau: is no column of a recording, must be level_m, inflow_m3h",
        ),
        (
            'tag = "PS07.P1.STATE"',
            'tag = ["a", "b"]',
            "signal.pump1_running.tag: got ['a', 'b'], input should be a valid",
        ),
        (
            "[signal.pump1_running]",
            "[signal.level_m]",
            "is not TOML: Cannot declare ('signal', 'level_m') twice (at line",
        ),
        ("offset = 0.0", "offset = nan", "signal.level_m.offset: got nan, input should be a finite number"),
        ("offset = 0.0", "scale = 0.0", "signal.level_m: scale: got 0, must not be 0"),
        ("offset = 0.0", "ofset = 0.0", "signal.level_m.ofset: unknown key"),
        ("offset = 0.0", 'true = ["EIN"]', "signal.level_m.true: is for pump1_running and so on"),
        ("offset = 0.0", "span = [0.0, 5.0]", "signal.level_m: span: is for unit '%', got unit 'cm'"),
        (
            'unit = "cm"',
            'unit = "%"',
            "signal.level_m.span: missing, [value at 0 %, value at 100 %] is needed for unit '%'",
        ),
        (
            'true = ["EIN", "1"]',
            'true = ["EIN"]\nfalse = ["ein"]',
            "signal.pump1_running: true, false: 'ein' stands in both",
        ),
        ('true = ["EIN", "1"]', 'false = ["AUS"]', "signal.pump1_running: false: needs 'true' beside it"),
        ('value = "value"\n', "", "columns.value: missing, a long file needs it"),
        ('good = ["GOOD", "192"]', "", "columns.good: is needed with a quality, and only there"),
        ('layout = "long"', 'layout = "wide"', "columns: a wide file has time alone"),
        (
            "offset = 0.0",
            'quality = "q"',
            "signal.level_m.quality: is for wide files; of a long one it is columns.quality",
        ),
        (
            'value = "instant"',
            'value = "held"',
            "max_age_s: missing; values stored on change need a time after which",
        ),
        ('value = "instant"', "max_age_s = 60.0", "max_age_s: is for value 'held', got value 'instant'"),
        (
            'value = "instant"',
            'time_format = "%H:%M"',
            "time_format: got '%H:%M', must be epoch_s, epoch_ms, epoch_us, epoch_ns, excel, or day",
        ),
        (
            'value = "instant"',
            'time_format = "%d.%q.%Y"',
            "time_format: got '%q' in '%d.%q.%Y', known are %Y, %y, %m",
        ),
        ("pump1_frequency_hz", "pump0_frequency_hz", "signal.pump0_frequency_hz: is no column of a recording"),
    ],
)
def test_a_mapping_that_breaks_a_rule_is_refused_in_one_line(tmp_path, old, new, said):
    assert old in GOOD
    path = written(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        load_mapping(path)
    assert str(caught.value).startswith(f"{path}: {said}")
    assert "\n" not in str(caught.value)


def test_a_mapping_without_pumps_is_refused(tmp_path):
    path = written(tmp_path, GOOD[: GOOD.index("[signal.pump1_frequency_hz]")])
    with pytest.raises(ConfigError, match="signal: no signal of a pump such as pump1_flow_m3h"):
        load_mapping(path)
