"""Several mains, delivery levels, points of volume, names and external control: what a station file takes of them."""

import copy
import tomllib

import pytest
import tomli_w
from pydantic import ValidationError

from wetwell.protocols.errors import first_fault
from wetwell.protocols.station.rising_main import RisingMain
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.station.sump import Sump

PUMP = {"curve": [36.0, -0.02, -1e-4]}
TWO = {
    "name": "two",
    "sump": {"volume_points": [[-1.0, 10.0], [0.0, 40.0], [2.0, 60.0]]},
    "main": [
        {"name": "line 1", "delivery_level_m": 30.0, "friction_h2_m5": 1e-5, "layout": "common"},
        {"name": "line 2", "static_head_m": 3.0},
    ],
    "pump": [
        PUMP | {"name": "1.1", "main": "line 1"},
        PUMP | {"main": "line 2", "power_points": [[100, 9.0], [200, 14.0]]},
        PUMP | {"name": "1.2", "main": "line 1", "efficiency_points": [[150, 0.7]]},
    ],
    "control": {"mode": "external"},
    "electrical": {"power_model": "load"},
}


def refused(table):
    with pytest.raises(ValidationError) as caught:
        Station.model_validate(table)
    return first_fault(caught.value)


def changed(*path, value):
    """The table with one value changed; None takes it away."""
    table = copy.deepcopy(TWO)
    *places, key = path
    inner = table
    for place in places:
        inner = inner[place]
    if value is None:
        del inner[key]
    else:
        inner[key] = value
    return table


def test_a_station_of_two_mains():
    station = Station.model_validate(TWO)
    assert [main.name for main in station.mains] == ["line 1", "line 2"]
    assert station.main_of_pump == (0, 1, 0)
    assert station.pump_names == ("1.1", "2", "1.2")
    assert [main.static_head_at_m(1.0) for main in station.mains] == [29.0, 3.0]
    assert [main.static_head_at_m(31.0) for main in station.mains] == [0.0, 3.0]
    assert station.control.start_levels_m == station.control.stop_levels_m == ()
    assert station.middle_level_m == 0.5


def test_one_rising_main_or_none_is_a_main_like_any_other():
    plain = {"name": "one", "sump": {"area_m2": 8.0}, "pump": [PUMP, PUMP]}
    for table in ({}, {"rising_main": {"static_head_m": 2.0, "friction_h2_m5": 6e-4}}):
        station = Station.model_validate(plain | table)
        assert station.mains == (RisingMain(static_head_m=2.0, friction_h2_m5=6e-4),)
        assert station.main_of_pump == (0, 0)
    lifted = Station.model_validate(plain | {"rising_main": {"delivery_level_m": 20.0}})
    assert lifted.mains[0].static_head_at_m(1.5) == 18.5


@pytest.mark.parametrize("table", [TWO, {"name": "s", "sump": {"area_m2": 8.0}, "pump": [PUMP]}])
def test_what_is_written_is_read_again(table):
    station = Station.model_validate(table)
    text = tomli_w.dumps(station.model_dump(exclude_none=True))
    assert Station.model_validate(tomllib.loads(text)) == station
    assert ("rising_main" in text) == ("main" not in table)


def test_mains_can_be_replaced():
    station = Station.model_validate(TWO)
    mains = [main.model_copy(update={"friction_h2_m5": 2e-5}) for main in station.mains]
    assert station.with_mains(mains).mains == tuple(mains)
    assert station.with_mains(mains).pump == station.pump
    with pytest.raises(ValidationError, match="shut-off head"):
        station.with_mains([main.model_copy(update={"delivery_level_m": 90.0}) for main in mains[:1]] + mains[1:])


@pytest.mark.parametrize(
    ("table", "line"),
    [
        (changed("rising_main", value={"static_head_m": 2.0}), "main: give either [rising_main] or [[main]]"),
        (
            changed("main", 0, "static_head_m", value=2.0),
            "main[1]: give either 'static_head_m' or 'delivery_level_m'",
        ),
        (changed("main", 1, "name", value=None), "main[2].name: missing"),
        (changed("main", 1, "name", value="line 1"), "main[2].name: 'line 1' is that of main[1] already"),
        (changed("main", 1, "name", value=" "), "main[2].name: got ' ', string should match pattern"),
        (changed("main", value=[]), "main: got [], tuple should have at least 1 item"),
        (changed("pump", 1, "main", value=None), "pump[2].main: missing, there are 'line 1', 'line 2'"),
        (changed("pump", 1, "main", value="3"), "pump[2].main: got '3', there are 'line 1', 'line 2'"),
        (changed("pump", 1, "main", value="line 1"), "main[2]: no pump has main = 'line 2'"),
        (changed("pump", 2, "name", value="2"), "pump[3].name: '2' is that of pump[2] already"),
        (
            changed("main", 0, "delivery_level_m", value=36.5),
            "pump[1]: shut-off head 36 m must exceed main[1].delivery_level_m = 36.5 less a level of 0.5 m",
        ),
        (changed("pump", 2, "power_points", value=[[1, 2]]), "pump[3]: give either 'power_points' or 'efficiency_"),
        (changed("pump", 1, "power_points", value=[]), "pump[2].power_points: got [], tuple should have at least"),
        (changed("pump", 1, "power_points", value=[[0, 9.0]]), "pump[2]: power_points: at least one flow above 0"),
        (
            changed("pump", 2, "efficiency_points", value=[[900, 0.7]]),
            "pump[3]: efficiency_points: the curve makes no",
        ),
        (changed("pump", 2, "efficiency_points", value=[[150, 70.0]]), "pump[3].efficiency_points[1][2]: got 70.0"),
        (
            changed("electrical", value={"power_model": "current"}),
            "pump[2].power_points: electrical.power_model must be 'load', or they mean nothing",
        ),
        (changed("sump", "area_m2", value=8.0), "sump: give either 'area_m2' or 'volume_points'"),
        (changed("sump", value={}), "sump: area_m2 is missing, or volume_points"),
        (
            changed("sump", "volume_points", value=[[0, 1]]),
            "sump: volume_points: at least two points (level_m, volume",
        ),
        (
            changed("sump", "volume_points", value=[[0, 1], [0, 2]]),
            "sump: volume_points: levels must rise, got [0.0, 0.0]",
        ),
        (
            changed("sump", "volume_points", value=[[0, 3], [1, 2]]),
            "sump: volume_points: volumes must rise, got [3.0, 2.0]",
        ),
        (
            changed("sump", "overflow_level_m", value=-2.0),
            "sump: overflow_level_m: got -2, must lie over the floor at",
        ),
        (
            changed("control", "start_levels_m", value=[1.0]),
            "control: start_levels_m: mode 'external' has no levels",
        ),
        (changed("control", "mode", value="levels"), "control.mode: got 'levels', input should be"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(table, line):
    assert refused(table).startswith(line)


def test_a_pump_may_name_a_main_only_where_one_has_that_name():
    table = {"name": "s", "sump": {"area_m2": 8.0}, "pump": [PUMP | {"main": "north"}]}
    assert refused(table) == "pump[1].main: got 'north', no main has a name"
    named = table | {"rising_main": {"name": "north"}}
    assert Station.model_validate(named).main_of_pump == (0,)


def test_the_floor_of_points_of_volume_is_where_the_wet_well_is_empty():
    """Under the first point the area of the first slice goes on: 10 m³ at 30 m² are a third of a metre."""
    sump = Sump(volume_points=((-1.0, 10.0), (0.0, 40.0), (2.0, 60.0)))
    assert sump.floor_level_m == pytest.approx(-1.0 - 1.0 / 3.0)
    assert sump.mean_area_m2 == pytest.approx(50.0 / 3.0)
    assert sump.slices == ((sump.floor_level_m, 30.0, 30.0), (0.0, 10.0, 10.0))
    assert Sump(area_m2=8.0).mean_area_m2 == 8.0
    assert Sump(area_m2=8.0).floor_level_m == 0.0
