"""Alarms as a table: what people call a pump stands beside its number, where it is known."""

from wetwell.protocols.messages.alarm import Alarm
from wetwell.services.alarms.tables import alarm_lines


def test_the_name_of_the_pump_stands_in_a_column_where_it_is_known() -> None:
    alarm = Alarm(
        id="pump2.pump_fault",
        time=0,
        station="sued",
        pump=2,
        priority="high",
        is_active=True,
        state="unacknowledged",
        text="pump fault",
        raised=0,
    )
    level = alarm.model_copy(update={"id": "level_high", "pump": None})
    shown = " ".join(alarm_lines([alarm, level], ("Süd 1", "Süd Nord")).split())
    assert "2 (Süd" in shown
    assert "Nord)" in shown
    assert "Süd 1" not in shown
    assert "Süd" not in alarm_lines([alarm, level])


def test_the_title_of_the_station_stands_beside_its_key_and_nobody_reads_nanoseconds() -> None:
    alarm = Alarm(
        id="level_high",
        time=0,
        station="sued",
        priority="high",
        is_active=True,
        state="unacknowledged",
        text="high level",
        raised=1_534_172_891,
    )
    shown = alarm_lines([alarm], title="Pumpwerk Süd")
    assert "sued (Pumpwerk" in shown
    assert "Süd)" in shown
    assert "  1970-01-01T00:00:01Z  " in shown
