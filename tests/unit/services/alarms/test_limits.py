"""From where the levels come that are too high."""

import pytest

from wetwell.protocols.station.station_file import Station
from wetwell.services.alarms.service import limits_of
from wetwell.services.runtime.settings import AlarmSettings

SETTINGS = AlarmSettings(high_level_margin_m=0.2, overflow_margin_m=0.1)
TABLE = {"name": "s", "sump": {"area_m2": 8.0}, "pump": [{"curve": [36.0, -0.02, -1e-4]}]}
EXTERNAL = {"control": {"mode": "external"}}


@pytest.mark.parametrize(
    ("changes", "limits"),
    [
        ({}, (1.8, None)),
        ({"sump": {"area_m2": 8.0, "overflow_level_m": 1.7}}, (1.6, 1.6)),
        (EXTERNAL, (None, None)),
        (EXTERNAL | {"sump": {"area_m2": 8.0, "overflow_level_m": 3.1}}, (3.0, 3.0)),
    ],
)
def test_a_station_that_nobodys_levels_drive_has_the_overflow_alone(changes, limits):
    found = limits_of(SETTINGS, Station.model_validate(TABLE | changes))
    assert (found.high_m, found.overflow_m) == tuple(level and pytest.approx(level) for level in limits)
