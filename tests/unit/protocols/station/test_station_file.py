"""The station file: what it takes, and the one line that each mistake in it gives."""

import math
import re

import numpy as np
import pytest
from pydantic import ValidationError

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.station.control import check_levels
from wetwell.protocols.station.curve_fit import fit_error_m, fit_pump_curve
from wetwell.protocols.station.pump import Pump
from wetwell.protocols.station.station_file import Station, load_station, load_toml

FULL = """\
name = "alpha"
[sump]
area_m2 = 8.0
[[pump]]                                   # one table per pump
curve = [36.0, -0.02333, -1.3333e-4]
nominal_frequency_hz = 50.0
[[pump]]
points = [[0.0, 36.0], [100.0, 32.3337], [200.0, 26.0008]]
[[pump]]
curve = [30, 0, -1e-4]
nominal_frequency_hz = 60
[rising_main]
static_head_m = 2.0
friction_h2_m5 = 6.0e-4
layout = "common"
[control]
start_levels_m = [1.6, 1.8, 2.0]
stop_levels_m = [0.5, 0.8, 1.0]
ramp_s = 10.0
min_frequency_hz = 20.0
dwell_s = 5.0
mode = "on_off"
[electrical]
voltage_v = 400.0
rated_current_a = 30.0
power_factor = 0.9
efficiency = 0.9
[sensors]
flow_noise = 0.01
head_noise = 0.01
power_noise = 0.01
level_noise_m = 0.002
[[effect]]
name = "air_pocket"
volume_m3 = 0.3
[[effect]]
name = "worn_valve"
"""
LEAST = 'name = "a"\n[sump]\narea_m2 = 8.0\n[[pump]]\ncurve = [36.0, -0.02, -1e-4]\n'


def written(tmp_path, text):
    path = tmp_path / "station.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_full_file_of_the_interface(tmp_path):
    station = load_station(written(tmp_path, FULL))
    assert station.name == "alpha"
    assert station.sump.area_m2 == 8.0
    assert station.pump[0].coefficients == (36.0, -0.02333, -1.3333e-4)
    assert station.pump[1].coefficients == pytest.approx((36.0, -0.02333, -1.3333e-4), rel=1e-6)
    assert [pump.nominal_frequency_hz for pump in station.pump] == [50.0, 50.0, 60.0]
    assert station.rising_main.layout == "common"
    assert (station.rising_main.static_head_m, station.rising_main.friction_h2_m5) == (2.0, 6e-4)
    assert station.control.start_levels_m == (1.6, 1.8, 2.0)
    assert station.control.stop_levels_m == (0.5, 0.8, 1.0)
    assert (station.control.ramp_s, station.control.min_frequency_hz, station.control.dwell_s) == (10.0, 20.0, 5.0)
    assert station.electrical.rated_current_a == 30.0
    assert station.sensors.level_noise_m == 0.002
    assert [effect.name for effect in station.effect] == ["air_pocket", "worn_valve"]
    assert station.effect[0].model_extra == {"volume_m3": 0.3}


def test_everything_but_name_area_and_pump_has_a_default(tmp_path):
    station = load_station(written(tmp_path, LEAST))
    assert station.rising_main.layout == "individual"
    assert (station.rising_main.static_head_m, station.rising_main.friction_h2_m5) == (2.0, 6e-4)
    assert station.control.start_levels_m == (1.6,)
    assert station.control.stop_levels_m == (0.5,)
    assert station.control.ramp_s == 10.0
    assert station.effect == ()


@pytest.mark.parametrize(("pumps", "levels"), [(1, 1), (2, 2), (3, 3), (5, 3), (32, 3)])
def test_default_levels_follow_the_number_of_pumps(pumps, levels):
    pump = {"curve": [36, 0, -1e-4]}
    station = Station.model_validate({"name": "n", "sump": {"area_m2": 1}, "pump": [pump] * pumps})
    assert station.control.start_levels_m == (1.6, 1.8, 2.0)[:levels]
    assert station.control.stop_levels_m == (0.5, 0.8, 1.0)[:levels]


def test_station_is_frozen(alpha):
    with pytest.raises(ValidationError, match="frozen"):
        alpha.sump.area_m2 = 9.0


def changed(old, new):
    assert FULL.count(old) == 1
    return FULL.replace(old, new)


BAD_FILES = {
    "unknown key": (changed("area_m2 = 8.0", "area_m2 = 8.0\ndepth_m = 3"), "sump.depth_m: unknown key"),
    "unknown table": (FULL + "[weather]\nrain = 1\n", "weather: unknown key"),
    "unknown key in a pump": (changed("curve = [30, 0,", "kurve = 1\ncurve = [30, 0,"), "pump[3].kurve: unknown key"),
    "unknown key over two lines": (changed("[rising_main]", '[rising_main]\n"two\\nlines" = 1'), "unknown key"),
    "misspelt needed key": (changed("area_m2 = 8.0", "area_m = 8.0"), "sump.area_m: unknown key"),
    "missing name": (changed('name = "alpha"\n', ""), "name: missing"),
    "missing area": (changed("area_m2 = 8.0\n", ""), "sump: area_m2 is missing, or volume_points"),
    "missing sump": (changed("[sump]\narea_m2 = 8.0\n", ""), "sump: missing"),
    "missing pump": ('name = "a"\n[sump]\narea_m2 = 8.0\n', "pump: missing"),
    "no pump": ('name = "a"\npump = []\n[sump]\narea_m2 = 8.0\n', "pump: got [], tuple should have at least 1 item"),
    "one pump, not a list": (
        'name = "a"\n[sump]\narea_m2 = 8.0\n[pump]\ncurve = [3, 0, -1]\n',
        "pump: is one table, must be a list of tables: write [[pump]]",
    ),
    "zero area": (changed("area_m2 = 8.0", "area_m2 = 0.0"), "sump.area_m2: got 0.0, input should be greater than 0"),
    "area not a number": (changed("area_m2 = 8.0", 'area_m2 = "big"'), "sump.area_m2: got 'big', input should be a"),
    "area NaN": (changed("area_m2 = 8.0", "area_m2 = nan"), "sump.area_m2: got nan, input should be"),
    "area infinite": (changed("area_m2 = 8.0", "area_m2 = inf"), "sump.area_m2: got inf, input should be a finite"),
    "curve NaN": (
        changed("[30, 0, -1e-4]", "[nan, 0, -1e-4]"),
        "pump[3].curve[1]: got nan, input should be a finite",
    ),
    "static head infinite": (
        changed("static_head_m = 2.0", "static_head_m = inf"),
        "rising_main.static_head_m: got inf",
    ),
    "power factor NaN": (changed("power_factor = 0.9", "power_factor = nan"), "electrical.power_factor: got nan"),
    "power factor over 1": (changed("power_factor = 0.9", "power_factor = 90"), "electrical.power_factor: got 90"),
    "negative noise": (changed("flow_noise = 0.01", "flow_noise = -0.01"), "sensors.flow_noise: got -0.01"),
    "negative friction": (changed("6.0e-4", "-6.0e-4"), "rising_main.friction_h2_m5: got -0.0006, input should be"),
    "zero ramp": (changed("ramp_s = 10.0", "ramp_s = 0"), "control.ramp_s: got 0, input should be greater than 0"),
    "stop over start": (
        changed("[0.5, 0.8, 1.0]", "[0.5, 1.8, 1.9]"),
        "control: stop_levels_m[2] = 1.8 must lie under start_levels_m[2] = 1.8",
    ),
    "levels fall": (changed("[1.6, 1.8, 2.0]", "[1.6, 1.5, 2.0]"), "must not fall from one pump to the next"),
    "level NaN": (changed("[1.6, 1.8, 2.0]", "[1.6, nan, 2.0]"), "control.start_levels_m[2]: got nan"),
    "start under stop": (
        changed("[1.6, 1.8, 2.0]", "[0.4, 1.8, 2.0]"),
        "control: stop_levels_m[1] = 0.5 must lie under start_levels_m[1] = 0.4",
    ),
    "last start equals its stop": (
        changed("[0.5, 0.8, 1.0]", "[0.5, 0.8, 2.0]"),
        "control: stop_levels_m[3] = 2 must lie under start_levels_m[3] = 2",
    ),
    "profile area zero": (
        changed("area_m2 = 8.0", "area_m2 = 8.0\nprofile = [[0.0, 0.0], [1.0, 8.0]]"),
        "sump.profile[1][2]: got 0.0, input should be greater than 0",
    ),
    "profile area falls to zero": (
        changed("area_m2 = 8.0", "area_m2 = 8.0\nprofile = [[0.0, 8.0], [1.0, 4.0], [2.0, 0.0]]"),
        "sump.profile[3][2]: got 0.0, input should be greater than 0",
    ),
    "profile area falls under zero": (
        changed("area_m2 = 8.0", "area_m2 = 8.0\nprofile = [[0.0, 8.0], [2.0, -1.0]]"),
        "sump.profile[2][2]: got -1.0, input should be greater than 0",
    ),
    "profile levels double": (
        changed("area_m2 = 8.0", "area_m2 = 8.0\nprofile = [[0.0, 8.0], [1.0, 4.0], [1.0, 5.0]]"),
        "sump: profile: levels must rise from 0, got [0.0, 1.0, 1.0]",
    ),
    "unequal numbers of levels": (
        changed("[1.6, 1.8, 2.0]", "[1.6, 1.8]"),
        "control: as many stop_levels_m as start_levels_m are needed, got 3 and 2",
    ),
    "more levels than pumps": (
        LEAST + "[control]\nstart_levels_m = [1, 2]\nstop_levels_m = [0, 1]\n",
        "control.start_levels_m: 2 levels for 1 pumps, at most one a pump",
    ),
    "no levels": (
        LEAST + "[control]\nstart_levels_m = []\nstop_levels_m = []\n",
        "control: start_levels_m: at least one level is needed",
    ),
    "only start levels": (LEAST + "[control]\nstart_levels_m = [1.0]\n", "control.stop_levels_m: missing, as start"),
    "only stop levels": (LEAST + "[control]\nstop_levels_m = [1.0]\n", "control.start_levels_m: missing, as stop"),
    "shut-off under static": (
        changed("static_head_m = 2.0", "static_head_m = 30.0"),
        "pump[3]: shut-off head 30 m must exceed rising_main.static_head_m = 30 m",
    ),
    "shut-off not positive": (changed("[30, 0, -1e-4]", "[0, 0, -1e-4]"), "pump[3]: curve: shut-off head c0 must be"),
    "rising curve": (changed("[30, 0, -1e-4]", "[30, 0.1, -1e-4]"), "pump[3]: curve: head must fall with flow"),
    "curve bends up": (changed("[30, 0, -1e-4]", "[30, -0.1, 1e-4]"), "pump[3]: curve: head must fall with flow"),
    "flat curve": (changed("[30, 0, -1e-4]", "[30, 0, 0]"), "pump[3]: curve: head must fall with flow"),
    "curve and points": (
        changed("curve = [30, 0, -1e-4]", "curve = [30, 0, -1e-4]\npoints = [[0, 9], [1, 8], [2, 6]]"),
        "pump[3]: give either 'curve' or 'points'",
    ),
    "neither curve nor points": (changed("curve = [30, 0, -1e-4]\n", ""), "pump[3]: give either 'curve' or 'points'"),
    "curve too short": (changed("[30, 0, -1e-4]", "[30, 0]"), "pump[3].curve[3]: missing"),
    "too few points": (
        changed("[[0.0, 36.0], [100.0, 32.3337], [200.0, 26.0008]]", "[[0, 9], [1, 8], [1, 8.1]]"),
        "pump[2]: a curve needs points at three different flows, got 2",
    ),
    "no points": (
        changed("[[0.0, 36.0], [100.0, 32.3337], [200.0, 26.0008]]", "[]"),
        "at three different flows, got 0",
    ),
    "rising points": (
        changed("[[0.0, 36.0], [100.0, 32.3337], [200.0, 26.0008]]", "[[0, 9], [1, 10], [2, 12]]"),
        "pump[2]: curve: head must fall with flow",
    ),
    "points that fall and rise": (
        changed("[[0.0, 36.0], [100.0, 32.3337], [200.0, 26.0008]]", "[[0, 36], [100, 10], [200, 30]]"),
        "pump[2]: points: the best falling curve misses them by 10.8 m, more than 10% of its",
    ),
    "negative flow in points": (changed("[[0.0, 36.0]", "[[-1.0, 36.0]"), "pump[2].points[1][1]: got -1.0"),
    "wrong layout": (
        changed('"common"', '"shared"'),
        "rising_main.layout: got 'shared', input should be 'individual'",
    ),
    "wrong mode": (
        changed('"on_off"', '"fuzzy"'),
        "control.mode: got 'fuzzy', input should be 'on_off', 'pid' or",
    ),
    "minimum over nominal": (
        changed("min_frequency_hz = 20.0", "min_frequency_hz = 51.0"),
        "control.min_frequency_hz: got 51, must not exceed pump[1].nominal_frequency_hz = 50",
    ),
    "zero nominal": (changed("nominal_frequency_hz = 60", "nominal_frequency_hz = 0"), "nominal_frequency_hz: got 0"),
    "name not a key chunk": (changed('"alpha"', '"pump/house"'), "name: got 'pump/house', string should match"),
    "name with a line end": (changed('"alpha"', '"alpha\\n"'), "name: got 'alpha\\n', string should match"),
    "name too long": (changed('"alpha"', f'"{"a" * 65}"'), "string should have at most 64 characters"),
    "effect without a name": (changed('name = "worn_valve"\n', ""), "effect[2].name: missing"),
    "bad TOML": (changed("area_m2 = 8.0", "area_m2 = = 8.0"), "is not TOML: Invalid value (at line 3, column 11)"),
    "key twice": (changed("area_m2 = 8.0", "area_m2 = 8.0\narea_m2 = 9.0"), "is not TOML: Cannot overwrite a value"),
    "not UTF-8": (FULL.replace("alpha", "Zürich").encode("latin-1"), "is not UTF-8 text"),
}


@pytest.mark.parametrize(("text", "rule"), BAD_FILES.values(), ids=BAD_FILES)
def test_bad_file_gives_one_line_with_file_and_rule(tmp_path, text, rule):
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_station(path)
    line = str(caught.value)
    assert line.isprintable()
    assert line.startswith(f"{path}: ")
    assert rule in line
    assert caught.value.__cause__ is not None


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(ConfigError, match=rf"^{re.escape(str(tmp_path))}/none\.toml: cannot be read: No such file"):
        load_station(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match=r"cannot be read: Is a directory$"):
        load_toml(tmp_path)


def test_too_many_pumps():
    pumps = [{"curve": [36, 0, -1e-4]}] * 33
    with pytest.raises(ValidationError) as caught:
        Station.model_validate({"name": "n", "sump": {"area_m2": 1}, "pump": pumps})
    assert "at most 32 items" in first_fault(caught.value)


def test_a_key_that_is_not_printable_stays_on_one_line():
    with pytest.raises(ValidationError) as caught:
        Station.model_validate(
            {"name": "n", "sump": {"area_m2": 1, "two\nlines": 3}, "pump": [{"curve": [9, 0, -1]}]}
        )
    assert first_fault(caught.value) == "sump.'two\\nlines': unknown key"


def test_further_faults_are_counted():
    table = {"name": "n", "sump": {"area_m2": 0}, "pump": [{"curve": [9, 0, -1]}], "electrical": {"voltage_v": 0}}
    with pytest.raises(ValidationError) as caught:
        Station.model_validate(table)
    assert first_fault(caught.value) == "sump.area_m2: got 0, input should be greater than 0 (and 1 more)"


@pytest.mark.parametrize("bad_m", [math.nan, math.inf, -math.inf])
def test_levels_must_be_finite(bad_m):
    with pytest.raises(ValueError, match="start and stop level 2 must be finite"):
        check_levels((1.0, bad_m), (0.0, 0.5))
    with pytest.raises(ValueError, match="start and stop level 1 must be finite"):
        check_levels((1.0, 2.0), (bad_m, 0.5))


CURVES = [(36.0, -0.02333, -1.3333e-4), (12.0, 0.0, -3e-3), (80.0, -0.4, 0.0)]


@pytest.mark.parametrize("curve", CURVES)
def test_datasheet_points_give_their_curve_back(curve):
    c0, c1, c2 = curve
    points = [(flow, c0 + c1 * flow + c2 * flow**2) for flow in (0.0, 10.0, 25.0, 40.0, 60.0)]
    assert fit_pump_curve(points) == pytest.approx(curve, rel=1e-9, abs=1e-11)
    assert Pump(points=tuple(points)).coefficients == pytest.approx(curve, rel=1e-9, abs=1e-11)
    assert fit_error_m(points, curve) == pytest.approx(0.0, abs=1e-12)


def test_fit_is_the_least_squares_one():
    """Inside the bounds it must be that of numpy.polyfit."""
    rng = np.random.default_rng(1)
    flow_m3h = np.linspace(0, 300, 12)
    head_m = 36 - 0.02333 * flow_m3h - 1.3333e-4 * flow_m3h**2 + rng.normal(0, 0.2, 12)
    points = list(zip(flow_m3h.tolist(), head_m.tolist(), strict=True))
    c2, c1, c0 = np.polyfit(flow_m3h, head_m, 2)
    assert c1 < 0
    assert fit_pump_curve(points) == pytest.approx((c0, c1, c2), rel=1e-9)
    misfit_m = head_m - np.polyval([c2, c1, c0], flow_m3h)
    assert fit_error_m(points, (c0, c1, c2)) == pytest.approx(math.sqrt(np.mean(misfit_m**2)))
    assert 0.1 < fit_error_m(points, (c0, c1, c2)) < 0.3


def test_fit_keeps_the_head_falling_where_the_points_bump():
    """A curve with a hump: the free parabola would rise at first, the bounded one starts flat."""
    points = [(0.0, 19.0), (50.0, 20.0), (100.0, 19.0), (150.0, 15.0)]
    assert np.polyfit(*np.array(points).T, 2)[1] > 0
    c0, c1, c2 = fit_pump_curve(points)
    assert c1 == pytest.approx(0.0, abs=1e-12)
    assert c2 < 0
    flow_m3h, head_m = np.array(points).T
    slope, intercept = np.polyfit(flow_m3h**2, head_m, 1)
    assert (c0, c2) == pytest.approx((intercept, slope), rel=1e-9)


def test_fit_error_of_a_known_misfit():
    points = [(0.0, 21.0), (100.0, 9.0), (50.0, 17.5)]
    assert fit_error_m(points, (20.0, 0.0, -0.001)) == pytest.approx(math.sqrt(2 / 3))
