"""Effects against closed forms, brentq and solve_ivp of equations that are written here a second time.

Where the kernel's equation is algebraic, or its step is exact for values held over a second, the tolerance is that of
the root finder (1e-6). Explicit steps of a first-order growth with time constant τ differ from the exponential by at
most 1 / (2 e τ) of the final value; tolerances name the step that they allow for.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, fsolve

from wetwell.protocols.station.control import Control
from wetwell.protocols.station.station_file import EffectTable
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.power import STANDING_LOSS_SHARE
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

C0, C1, C2 = 36.0, -0.02333, -1.3333e-4
STATIC_M, FRICTION, AREA_M2 = 2.0, 6e-4, 8.0
NOMINAL_HZ = 50.0
START_M, STOP_M = (1.6, 1.8, 2.0), (0.5, 0.8, 1.0)
EXACT = 1e-6


def run(station, *effects, inflow_m3h=91.0, level_m=1.59, seconds=900, pumps=3):
    """Columns and truth; `pumps` limits how many may run."""
    control = Control(start_levels_m=START_M[:pumps], stop_levels_m=STOP_M[:pumps])
    tables = tuple(EffectTable(**effect) for effect in effects)
    station = station.model_copy(update={"control": control, "effect": tables})
    inflow = RecordedInflow(time_s=[0.0], flow_m3h=[inflow_m3h])
    recording = Simulation(station, Scenario(name="r", initial_level_m=level_m, inflow=inflow), 1).advance(seconds)
    return {**recording.columns, **recording.truth}


def head_m(speed, flow_m3h):
    return C0 * speed**2 + C1 * speed * flow_m3h + C2 * flow_m3h**2


def duty_m3h(static_m=STATIC_M, friction=FRICTION, speed=1.0):
    return brentq(lambda q: head_m(speed, q) - static_m - friction * q**2, 0.0, 1e3, xtol=1e-12)


def speeds_of(rows, pump=1):
    """Speed ratio that flow and head of a pump tell: the positive root of the pump curve."""
    q, h = rows[f"pump{pump}_flow_m3h"], rows[f"pump{pump}_head_m"]
    return (-C1 * q + np.sqrt((C1 * q) ** 2 - 4 * C0 * (C2 * q**2 - h))) / (2 * C0)


def steady(rows, pump=1):
    return rows[f"pump{pump}_frequency_hz"] == NOMINAL_HZ


def first_run(rows, pump=1):
    """Seconds from the first start until the frequency is back at zero."""
    on = rows[f"pump{pump}_frequency_hz"] > 0
    begin = int(np.argmax(on))
    return slice(begin, begin + int(np.argmin(on[begin:])))


@pytest.mark.parametrize(
    ("effect", "static_m", "friction"),
    [
        ({"name": "friction_bias", "factor": 1.7}, STATIC_M, 1.7 * FRICTION),
        ({"name": "static_head_bias", "offset_m": 4.0}, 6.0, FRICTION),
        ({"name": "static_head_bias", "offset_m": -1.5}, 0.5, FRICTION),
    ],
)
def test_biases_of_the_main_move_the_duty_point(quiet_alpha, effect, static_m, friction):
    rows = run(quiet_alpha, effect)
    flow_m3h = rows["pump1_flow_m3h"][steady(rows)]
    np.testing.assert_allclose(flow_m3h, duty_m3h(static_m, friction), atol=EXACT)


@pytest.mark.parametrize("exponent", [1.75, 1.852, 1.95])
def test_a_smooth_main_touches_the_power_law_at_the_rated_flow(quiet_alpha, exponent):
    """Value and slope there are those of k Q^n; at a lower flow it is off by 3 % of the loss there."""
    rated_m3h = duty_m3h()
    law = FRICTION * rated_m3h ** (2.0 - exponent)
    smooth = {"name": "friction_bias", "factor": 1.0, "loss_exponent": exponent}
    rows = run(quiet_alpha, smooth)
    np.testing.assert_allclose(rows["pump1_flow_m3h"][steady(rows)], rated_m3h, atol=EXACT)
    rise_m = 1e-3
    rows = run(quiet_alpha, smooth, {"name": "static_head_bias", "offset_m": rise_m})
    expected = brentq(lambda q: head_m(1.0, q) - STATIC_M - rise_m - law * q**exponent, 0.0, 1e3, xtol=1e-12)
    np.testing.assert_allclose(rows["pump1_flow_m3h"][steady(rows)], expected, atol=1e-6)
    rows = run(quiet_alpha, smooth, {"name": "static_head_bias", "offset_m": 12.0})
    flow_m3h = rows["pump1_flow_m3h"][steady(rows)]
    assert 0.5 * rated_m3h < flow_m3h.min() < 0.9 * rated_m3h
    lost_m = head_m(1.0, flow_m3h) - STATIC_M - 12.0
    np.testing.assert_allclose(lost_m, law * flow_m3h**exponent, atol=0.03 * FRICTION * rated_m3h**2)
    assert (lost_m > FRICTION * flow_m3h**2 * 1.01).all()


def test_lift_follows_the_level(quiet_alpha):
    rows = run(quiet_alpha, {"name": "level_dependent_static_head", "slope": 1.5, "reference_level_m": 1.2})
    seconds = np.flatnonzero(steady(rows))[::20]
    assert seconds.size > 10
    expected = [duty_m3h(STATIC_M - 1.5 * (level_m - 1.2)) for level_m in rows["truth_level_m"][seconds]]
    assert np.ptp(expected) > 3
    np.testing.assert_allclose(rows["pump1_flow_m3h"][seconds], expected, atol=EXACT)


@pytest.mark.parametrize("share", [1.0, 0.6, 0.0])
@pytest.mark.parametrize("pumps", [1, 2, 3])
def test_common_header_duty(quiet_alpha, share, pumps):
    effect = {"name": "common_header", "shared_fraction": share}
    rows = run(quiet_alpha, effect, inflow_m3h=600.0, level_m=2.2, seconds=40, pumps=pumps)

    def excess(q):
        return head_m(1.0, q) - STATIC_M - FRICTION * (share * (pumps * q) ** 2 + (1 - share) * q**2)

    expected = brentq(excess, 0.0, 1e3, xtol=1e-12)
    flows = np.array([rows[f"pump{i}_flow_m3h"][-1] for i in (1, 2, 3)])
    np.testing.assert_allclose(flows, [expected] * pumps + [0.0] * (3 - pumps), atol=EXACT)
    assert rows["pump1_head_m"][-1] == pytest.approx(head_m(1.0, expected), abs=EXACT)


def test_common_header_with_a_worn_pump_and_rough_main(quiet_alpha):
    """Effects compose: three unequal pumps on a header of 1.3 k, 80 % of it shared."""
    rows = run(
        quiet_alpha,
        {"name": "pump_wear", "pump": 2, "head_loss": 0.1},
        {"name": "friction_bias", "factor": 1.3},
        {"name": "common_header", "shared_fraction": 0.8},
        inflow_m3h=400.0,
        level_m=2.2,
        seconds=40,
    )
    keep = np.array([1.0, 0.9, 1.0])

    def balance(q):
        return keep * head_m(1.0, q) - STATIC_M - 1.3 * FRICTION * (0.8 * np.sum(q) ** 2 + 0.2 * q**2)

    expected = fsolve(balance, [90.0, 90.0, 90.0], xtol=1e-13)
    np.testing.assert_allclose([rows[f"pump{i}_flow_m3h"][-1] for i in (1, 2, 3)], expected, atol=EXACT)


@pytest.mark.parametrize(("inertia_s2_m2", "worst_m3h"), [(1000.0, 0.1), (5000.0, 0.02), (30000.0, 0.002)])
def test_water_inertia(quiet_alpha, inertia_s2_m2, worst_m3h):
    """Three steps a second of second order; the flow changes by 20 m³/h in a second at most."""
    rows = run(quiet_alpha, {"name": "water_inertia", "inertia_s2_m2": inertia_s2_m2}, seconds=500)
    flow_m3h, means_m3h = 0.0, []
    for frequency_hz in rows["pump1_frequency_hz"]:

        def slope(_t, y, n=frequency_hz / NOMINAL_HZ):
            q = max(y[0], 0.0)
            rise = 3600.0 * (head_m(n, q) - STATIC_M - FRICTION * q**2) / inertia_s2_m2
            return [rise if y[0] > 0 or rise > 0 else 0.0, q]

        if frequency_hz > 0 or flow_m3h > 0:
            step = solve_ivp(slope, (0.0, 1.0), [flow_m3h, 0.0], rtol=1e-6, atol=1e-6, max_step=0.1)
            flow_m3h = max(step.y[0, -1], 0.0)
            means_m3h.append(step.y[1, -1])
        else:
            means_m3h.append(0.0)
    plain = run(quiet_alpha, seconds=500)["pump1_flow_m3h"]
    assert np.max(np.abs(rows["pump1_flow_m3h"] - plain)) > 5 * worst_m3h
    np.testing.assert_allclose(rows["pump1_flow_m3h"], means_m3h, rtol=0, atol=worst_m3h)
    if inertia_s2_m2 < 10_000.0:
        np.testing.assert_allclose(rows["pump1_flow_m3h"][first_run(rows)][100:-20], duty_m3h(), atol=1e-3)


def water_column(frequencies_hz, inertia_s2_m2, wave_s, cells=80):
    """Mean flows of each second of a pump on an elastic column of as many cells, by the method of lines."""
    inertia, elasticity = inertia_s2_m2 / 3600.0 / cells, wave_s**2 * 3600.0 / (4.0 * inertia_s2_m2 * cells)
    masses = inertia * np.array([0.5, *[1.0] * (cells - 1), 0.5])
    losses = FRICTION / cells * np.array([0.5, *[1.0] * (cells - 1), 0.5])

    def slope(_t, y, n):
        flows, heads = y[: cells + 1].copy(), np.array([0.0, *y[cells + 1 : -1], STATIC_M])
        flows[0] = max(flows[0], 0.0)
        heads[0] = head_m(n, flows[0])
        rises = (heads[:-1] - heads[1:] - losses * flows * abs(flows)) / masses
        rises[0] = rises[0] if y[0] > 0.0 or rises[0] > 0.0 else 0.0
        return [*rises, *(flows[:-1] - flows[1:]) / elasticity, flows[0]]

    state, means_m3h = np.array([*np.zeros(cells + 1), *np.full(cells, STATIC_M), 0.0]), []
    for frequency_hz in frequencies_hz:
        state[-1] = 0.0
        state = solve_ivp(slope, (0.0, 1.0), state, args=(frequency_hz / NOMINAL_HZ,), rtol=1e-5, atol=1e-5).y[:, -1]
        means_m3h.append(state[-1])
    return np.array(means_m3h)


@pytest.mark.parametrize(
    ("wave_s", "rigid_off_m3h"),
    [*(pytest.param(*one, marks=pytest.mark.long) for one in [(0.8, 0.3), (3.3, 5.0)]), (9.0, 20.0)],
)
def test_waves_in_a_long_main(quiet_alpha, wave_s, rigid_off_m3h):
    """Start, run and stop of a pump; a front comes within a third of a second, and over one of 80 cells."""
    small = quiet_alpha.model_copy(update={"sump": quiet_alpha.sump.model_copy(update={"area_m2": 3.0})})
    effect = {"name": "water_inertia", "inertia_s2_m2": 3000.0, "wave_s": wave_s}
    rows = run(small, effect, inflow_m3h=20.0, seconds=180, pumps=1)
    expected_m3h = water_column(rows["pump1_frequency_hz"], 3000.0, wave_s)
    assert 60 < np.sum(expected_m3h > 1.0) < 150
    assert expected_m3h[-1] == 0.0
    off_m3h = rows["pump1_flow_m3h"] - expected_m3h
    assert np.max(np.abs(off_m3h)) < 1.5
    rigid = run(small, effect | {"wave_s": 0.0}, inflow_m3h=20.0, seconds=180, pumps=1)
    assert np.max(np.abs(rigid["pump1_flow_m3h"] - rows["pump1_flow_m3h"])) > rigid_off_m3h


@pytest.mark.parametrize("header", [(), ({"name": "common_header"},)], ids=["individual", "common"])
def test_air_pocket_grows_and_is_purged_in_each_main(quiet_alpha, header):
    """What head and flow tell of the air, H - H_s - k Q², against the two exponentials; full at the beginning."""
    head, growth_s, purge_s = 5.0, 600.0, 60.0
    effect = {"name": "air_pocket", "head_m": head, "growth_s": growth_s, "purge_s": purge_s}
    rows = run(quiet_alpha, effect, *header, level_m=1.0, seconds=2400)
    flows_m3h = np.array([rows[f"truth_pump{i}_flow_m3h"] for i in (1, 2, 3)])
    mains_m3h = np.broadcast_to(flows_m3h.sum(axis=0), flows_m3h.shape) if header else flows_m3h
    begins, peaks_m = 0, []
    for pump, main_m3h in enumerate(mains_m3h, start=1):
        air_m = head
        for second, flow_m3h in enumerate(main_m3h):
            if flows_m3h[pump - 1, second] > 0:
                seen_m = rows[f"pump{pump}_head_m"][second] - STATIC_M - FRICTION * flow_m3h**2
                assert seen_m == pytest.approx(air_m, abs=head / (2 * purge_s))
                begins += flows_m3h[pump - 1, second - 1] == 0
                peaks_m += [air_m] if flows_m3h[pump - 1, second - 1] == 0 else []
            decay = math.exp(-1 / purge_s) if flow_m3h > 0 else math.exp(-1 / growth_s)
            limit_m = 0.0 if flow_m3h > 0 else head
            air_m = limit_m + (air_m - limit_m) * decay
    assert begins >= 3
    assert max(peaks_m) == pytest.approx(head)
    assert min(peaks_m) < (0.8 if header else 1.0) * head


@pytest.mark.parametrize(
    ("bottom", "height_m", "exponent", "top"),
    [(0.5, 1.0, 1.0, 1.0), (2.5, 0.7, 1.0, 1.0), (0.6, 0.8, 1.0, 1.4), (0.6, 0.7, 2.0, 1.0), (0.6, 0.7, 10.0, 1.0)],
)
def test_sump_area_profile(quiet_alpha, bottom, height_m, exponent, top):
    """Filled at a constant rate, the volume under a level is the area's integral; of curved walls within .5 %."""
    effect = {"name": "sump_area_profile", "bottom_factor": bottom, "height_m": height_m, "top_factor": top}
    effect |= {"exponent": exponent}
    rows = run(quiet_alpha, effect, inflow_m3h=60.0, level_m=0.05, seconds=500)

    def area_m2(level_m):
        below = bottom + (1 - bottom) * (level_m / height_m) ** exponent
        above = 1 + (top - 1) * min(level_m / height_m - 1, 1)
        return AREA_M2 * (below if level_m < height_m else above)

    for second in (0, 100, 250, 499):
        level_m = rows["level_m"][second]
        volume_m3 = quad(area_m2, 0.05, level_m, points=[height_m, 2 * height_m], epsabs=1e-12)[0]
        assert volume_m3 == pytest.approx(60.0 / 3600.0 * second, rel=0.0 if exponent == 1.0 else 0.005, abs=1e-9)
    assert not rows["pump1_running"].any()


def test_unmetered_inflow_raises_the_level_and_no_meter(quiet_alpha):
    rows = run(quiet_alpha, {"name": "unmetered_inflow", "flow_m3h": 40.0}, level_m=0.6, seconds=100)
    np.testing.assert_allclose(np.diff(rows["level_m"]), (91.0 + 40.0) / 3600.0 / AREA_M2, atol=1e-12)
    assert set(rows["inflow_m3h"]) == {91.0}


def test_unmetered_inflow_swings_with_the_day(quiet_alpha):
    """Its mean over a day is that of no swing; the time of the day is that of the clock, not of the start."""
    effect = {"name": "unmetered_inflow", "flow_m3h": 2.0, "daily_share": 0.5, "daily_phase_h": 8.0}
    station = quiet_alpha.model_copy(update={"sump": quiet_alpha.sump.model_copy(update={"area_m2": 1e4})})
    station = station.model_copy(update={"effect": (EffectTable(**effect),)})
    inflow = RecordedInflow(time_s=[0.0], flow_m3h=[0.0])
    scenario = Scenario(name="r", start_time="2026-03-01T05:00:00Z", initial_level_m=0.6, inflow=inflow)
    rows = Simulation(station, scenario, 1).advance(86_400).columns
    hour = 5.0 + np.arange(86_399) / 3600.0
    coming_m3h = 2.0 * (1.0 + 0.5 * np.cos(2.0 * np.pi * (hour - 8.0) / 24.0))
    np.testing.assert_allclose(np.diff(rows["level_m"]), coming_m3h / 3600.0 / 1e4, atol=1e-12)


def test_check_valve_leak_after_a_stop(quiet_alpha):
    """Three standing pumps give back 3 K sqrt(H_s)."""
    rows = run(quiet_alpha, {"name": "check_valve_leak", "leak_m3h": 10.0}, inflow_m3h=60.0)
    stop = first_run(rows).stop
    rise_m = np.diff(rows["level_m"])[stop : stop + 100]
    np.testing.assert_allclose(rise_m, (60.0 + 30.0 * math.sqrt(STATIC_M)) / 3600.0 / AREA_M2, atol=1e-12)
    assert rows["pump1_flow_m3h"][stop] == 0


def test_check_valve_leak_behind_a_common_header(quiet_alpha):
    """What runs back through two standing pumps is missing in the main: the running one carries more, at less head.

    As long as its flow is even, neither inertia nor waves change that.
    """

    def back_of(header_m):
        return 2 * 8.0 * math.sqrt(header_m)

    def excess_m(main_m3h):
        header_m = STATIC_M + FRICTION * main_m3h**2
        return head_m(1.0, main_m3h + back_of(header_m)) - header_m

    main_m3h = brentq(excess_m, 0.0, 1e3, xtol=1e-12)
    header_m = STATIC_M + FRICTION * main_m3h**2
    flow_m3h = main_m3h + back_of(header_m)
    assert flow_m3h > duty_m3h() + 10.0
    leak, header = {"name": "check_valve_leak", "leak_m3h": 8.0}, {"name": "common_header"}
    column = {"name": "water_inertia", "inertia_s2_m2": 60.0}
    for more in ([], [column], [column | {"wave_s": 2.5}]):
        rows = run(quiet_alpha, leak, header, *more, seconds=120)
        tolerance = 1e-9 if not more else 1e-4  # waves die out
        np.testing.assert_allclose(rows["pump1_flow_m3h"][90:], flow_m3h, rtol=tolerance)
        np.testing.assert_allclose(rows["pump1_head_m"][90:], header_m, rtol=tolerance)
        fall_m = np.diff(rows["level_m"])[90:]
        np.testing.assert_allclose(fall_m, (91.0 + back_of(header_m) - flow_m3h) / 3600.0 / AREA_M2, atol=1e-7)


def test_sticking_check_valve_holds_the_shut_off_head_until_it_opens(quiet_alpha):
    """No flow until c0 N² exceeds the static head by what it takes; then the duty of the moment, and no sticking."""
    opening_m = 9.0
    rows, plain = run(quiet_alpha, {"name": "sticking_check_valve", "opening_m": opening_m}), run(quiet_alpha)
    start = first_run(plain).start
    ramp = slice(start, start + 30)
    ratio = rows["pump1_frequency_hz"][ramp] / NOMINAL_HZ
    is_shut = C0 * ratio**2 <= STATIC_M + opening_m
    assert 0 < is_shut.sum() < 30
    assert (plain["pump1_flow_m3h"][ramp][is_shut] > 0.0).any()
    expected_m3h = np.where(is_shut, 0.0, plain["pump1_flow_m3h"][ramp])
    np.testing.assert_array_equal(rows["pump1_flow_m3h"][ramp], expected_m3h)
    np.testing.assert_allclose(rows["pump1_head_m"][ramp][is_shut], C0 * ratio[is_shut] ** 2, rtol=1e-12)
    run_down = slice(ramp.stop, first_run(rows).stop)  # an open flap stays open while water flows
    ratio = rows["pump1_frequency_hz"][run_down] / NOMINAL_HZ
    is_low = (C0 * ratio**2 > STATIC_M + 0.5) & (C0 * ratio**2 < STATIC_M + opening_m)
    assert is_low.any()
    assert (rows["pump1_flow_m3h"][run_down][is_low] > 0.0).all()


def test_sticking_check_valve_of_one_pump_opens_against_what_another_one_pumps(quiet_alpha):
    """On a header the head behind it is that of the running pumps; the valves of the others do not stick."""
    sticking = {"name": "sticking_check_valve", "opening_m": 4.0, "pump": 2}
    header = {"name": "common_header"}
    rows, plain = (run(quiet_alpha, *effects, inflow_m3h=300.0) for effects in ([sticking, header], [header]))
    second = int(np.argmax(rows["pump2_frequency_hz"] > 0.0))
    np.testing.assert_array_equal(rows["pump1_flow_m3h"][:second], plain["pump1_flow_m3h"][:second])
    behind_m = STATIC_M + FRICTION * rows["pump1_flow_m3h"][second - 1] ** 2
    ratio = rows["pump2_frequency_hz"][second : second + 60] / NOMINAL_HZ
    opens = int(np.argmax(C0 * ratio**2 > behind_m + 4.0))
    assert opens > int(np.argmax(C0 * ratio**2 > behind_m))
    flow_m3h = rows["pump2_flow_m3h"][second : second + 60]
    assert (flow_m3h[:opens] == 0.0).all()
    assert (flow_m3h[opens:] > 0.0).all()


def test_sticking_check_valve_that_a_pump_cannot_open_moves_no_water(quiet_alpha):
    column = {"name": "water_inertia", "inertia_s2_m2": 300.0}
    rows = run(quiet_alpha, {"name": "sticking_check_valve", "opening_m": 50.0}, column)
    assert (rows["pump1_flow_m3h"] == 0.0).all()
    assert rows["pump1_head_m"].max() == pytest.approx(C0)


@pytest.mark.parametrize("inertia_s2_m2", [100.0, 1000.0])
def test_the_water_of_a_header_starts_from_what_runs_back_through_it(quiet_alpha, inertia_s2_m2):
    """Its pump lifts what runs back at once, and has to turn the water of the main round."""
    leak_m3h = 2 * 8.0

    def pumped_m3h(n, header_m):
        lift_m = C0 * n**2 - header_m
        return 2.0 * lift_m / (-C1 * n + math.sqrt((C1 * n) ** 2 - 4.0 * C2 * lift_m)) if lift_m > 0.0 else 0.0

    def header_m(n, main_m3h):
        def excess_m3h(head_m):
            return pumped_m3h(n, head_m) - leak_m3h * math.sqrt(head_m) - main_m3h

        return brentq(excess_m3h, 0.0, 100.0, xtol=1e-10)

    def slope(_t, y, n):
        head_m = header_m(n, y[0])
        return [3600.0 * (head_m - STATIC_M - FRICTION * y[0] * abs(y[0])) / inertia_s2_m2, pumped_m3h(n, head_m)]

    effects = [{"name": "check_valve_leak", "leak_m3h": 8.0}, {"name": "common_header"}]
    effects.append({"name": "water_inertia", "inertia_s2_m2": inertia_s2_m2})
    rows = run(quiet_alpha, *effects, seconds=40, level_m=1.61)
    turns = np.flatnonzero(rows["pump1_frequency_hz"] > 0.0)
    main_m3h = -brentq(lambda q: q - 3 * 8.0 * math.sqrt(max(STATIC_M - FRICTION * q**2, 0.0)), 0.0, 60.0, xtol=1e-12)
    for second in turns[:30]:
        n = rows["pump1_frequency_hz"][second] / NOMINAL_HZ
        main_m3h, mean_m3h = solve_ivp(slope, (0.0, 1.0), [main_m3h, 0.0], args=(n,), rtol=1e-7, atol=1e-7).y[:, -1]
        assert rows["pump1_flow_m3h"][second] == pytest.approx(mean_m3h, abs=0.5), second
    assert main_m3h > 100.0


@pytest.mark.parametrize(
    ("loss", "leak_m3h", "vane_loss_m"), [(0.2, 0.0, 0.0), (0.0, 30.0, 0.0), (0.0, 0.0, 3.0), (0.1, 15.0, 1.5)]
)
def test_pump_wear_duty_of_one_pump(quiet_alpha, loss, leak_m3h, vane_loss_m):
    effect = {"name": "pump_wear", "head_loss": loss, "leak_m3h": leak_m3h, "vane_loss_m": vane_loss_m, "pump": 2}
    rows = run(quiet_alpha, effect, inflow_m3h=600.0, level_m=2.2, seconds=40)
    square = FRICTION + vane_loss_m / plant_parameters(quiet_alpha).rated_flow_m3h[1] ** 2
    worn = brentq(lambda q: (1 - loss) * head_m(1.0, q + leak_m3h) - STATIC_M - square * q**2, 0, 1e3, xtol=1e-12)
    flows = [rows[f"pump{i}_flow_m3h"][-1] for i in (1, 2, 3)]
    np.testing.assert_allclose(flows, [duty_m3h(), worn, duty_m3h()], atol=EXACT)


def rags(rows, start, seconds, growth_s):
    """Share of the rags that the water since a start has brought: that of a second is there in the next but one."""
    seconds = np.atleast_1d(seconds)
    runs_s = np.array([rows["pump1_flow_m3h"][start : start + second - 1].sum() for second in seconds]) / duty_m3h()
    return 1.0 - np.exp(-runs_s / growth_s)


def test_ragging_grows_with_the_water_of_a_run_and_is_shed_at_the_stop(quiet_alpha):
    limit, growth_s = 0.2, 120.0
    effect = {"name": "ragging", "speed_loss": limit, "growth_s": growth_s, "pump": 1}
    rows = run(quiet_alpha, effect, seconds=3000)
    starts = np.flatnonzero((rows["pump1_frequency_hz"][1:] > 0) & (rows["pump1_frequency_hz"][:-1] == 0)) + 1
    assert starts.size >= 2
    for start in starts[:2]:
        seconds = np.arange(10, 250)
        loss = 1.0 - speeds_of(rows)[start + seconds]
        expected = limit * rags(rows, start, seconds, growth_s)
        np.testing.assert_allclose(loss, expected, rtol=0, atol=limit / (2 * growth_s))
    assert speeds_of(rows)[starts[1]] == pytest.approx(0.1, abs=1e-9)
    np.testing.assert_allclose(speeds_of(rows, 2)[steady(rows, 2)], 1.0, atol=1e-9)


def test_rags_that_throttle_cost_head_with_the_square_of_the_flow(quiet_alpha):
    throttle_m, growth_s = 6.0, 120.0
    effect = {"name": "ragging", "throttle_m": throttle_m, "growth_s": growth_s, "pump": 1}
    rows = run(quiet_alpha, effect, inflow_m3h=600.0, level_m=2.2, seconds=400)
    (start, *_) = np.flatnonzero(rows["pump1_frequency_hz"] > 0)
    for second in (60, 150, 300):
        (share,) = rags(rows, start, second, growth_s)
        square = FRICTION + share * throttle_m / duty_m3h() ** 2
        throttled = brentq(lambda q, k=square: head_m(1.0, q) - STATIC_M - k * q**2, 0, 1e3, xtol=1e-12)
        assert rows["pump1_flow_m3h"][start + second] == pytest.approx(throttled, rel=2e-3)
    assert rows["pump2_flow_m3h"][-1] == pytest.approx(duty_m3h(), abs=EXACT)


@pytest.mark.parametrize("slip", [0.05, 0.15])
def test_motor_slip_follows_the_torque(quiet_alpha, slip):
    """Torque over the rated one at the real speed n: n (0.4 n + 0.6 Q / Q_n); power as commanded."""
    rows, plain = run(quiet_alpha, {"name": "motor_slip", "slip": slip}, seconds=120), run(quiet_alpha, seconds=120)
    speed, _ = slipping(slip)
    assert rows["pump1_flow_m3h"][60] == pytest.approx(duty_m3h(speed=speed), abs=EXACT)
    assert speeds_of(rows)[60] == pytest.approx(speed, abs=1e-8)
    np.testing.assert_array_equal(rows["pump1_power_kw"][:120], plain["pump1_power_kw"])


@pytest.mark.parametrize("slip", [0.05, 0.15])
def test_a_motor_that_slips_takes_its_torque_at_the_speed_of_the_field(quiet_alpha, slip):
    """Where the power follows the load: that of the shaft, and what the rotor turns into heat."""
    load = {"name": "load_dependent_power", "share": 1.0, "shutoff_share": 0.4}
    rows = run(quiet_alpha, load, {"name": "motor_slip", "slip": slip}, seconds=120)
    plain = run(quiet_alpha, load, seconds=120)
    _, torque = slipping(slip)
    expected = (torque + STANDING_LOSS_SHARE) / (1.0 + STANDING_LOSS_SHARE)
    assert rows["pump1_power_kw"][60] / plain["pump1_power_kw"][60] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("losses_share", [0.0, 0.005, 0.1])
def test_constant_losses_are_a_share_of_the_rated_power_and_leave_that_at_rated_load(quiet_alpha, losses_share):
    load = {"name": "load_dependent_power", "share": 1.0, "shutoff_share": 0.4}
    rows = run(quiet_alpha, load, {"name": "constant_losses", "losses_share": losses_share})
    plain = run(quiet_alpha, load)
    start = first_run(plain).start
    ratio, flow_m3h = (rows[f"pump1_{name}"][start : start + 60] for name in ("frequency_hz", "flow_m3h"))
    ratio = ratio / NOMINAL_HZ
    shaft = ratio**2 * (0.4 * ratio + 0.6 * flow_m3h / duty_m3h())
    expected = (shaft + losses_share) / (1.0 + losses_share)
    power_kw, full_kw = rows["pump1_power_kw"][start : start + 60], plain["pump1_power_kw"][start + 59]
    assert ratio.min() < 0.3
    np.testing.assert_allclose(power_kw / full_kw, expected, rtol=5e-3)


def test_a_pump_that_the_water_overtakes_reads_no_head(quiet_alpha):
    """Its curve would be negative there: it raises nothing, as one that stands."""
    rows = run(quiet_alpha, {"name": "water_inertia", "inertia_s2_m2": 3000.0})
    ratio, flow_m3h = rows["pump1_frequency_hz"] / NOMINAL_HZ, rows["pump1_flow_m3h"]
    by_curve = C0 * ratio**2 + C1 * ratio * flow_m3h + C2 * flow_m3h**2
    is_overtaken = (by_curve < 0.0) & (ratio > 0.0)
    assert is_overtaken.any()
    assert (rows["pump1_head_m"][is_overtaken] == 0.0).all()


def slipping(slip):
    """Speed and torque over the rated ones of a pump whose motor slips, alone on its main."""

    def torque(speed):
        return speed * (0.4 * speed + 0.6 * duty_m3h(speed=speed) / duty_m3h())

    speed = brentq(lambda n: 1 - slip * torque(n) - n, 0.7, 1.0, xtol=1e-12)
    return speed, torque(speed)


@pytest.mark.parametrize("exponent", [2.0, 3.0])
def test_power_of_a_motor_that_slips_falls_with_a_power_of_its_speed(quiet_alpha, exponent):
    slips = {"name": "motor_slip", "slip": 0.1, "power_exponent": exponent}
    rows, plain = run(quiet_alpha, slips, seconds=120), run(quiet_alpha, seconds=120)
    settled = slice(60, 120)
    expected = plain["pump1_power_kw"][settled] * speeds_of(rows)[settled] ** exponent
    np.testing.assert_allclose(rows["pump1_power_kw"][settled], expected, rtol=1e-6)
    for name in ("pump1_flow_m3h", "pump1_head_m"):
        np.testing.assert_array_equal(
            rows[name], run(quiet_alpha, slips | {"power_exponent": 0.0}, seconds=120)[name]
        )


def test_a_second_slip_leaves_the_power_of_the_first(quiet_alpha):
    """A station file has what was diagnosed; what is tried beside it must change nothing where it is neutral."""
    slips = {"name": "motor_slip", "slip": 0.05, "power_exponent": 2.0}
    alone = run(quiet_alpha, slips, seconds=120)
    beside = run(quiet_alpha, slips, slips | {"slip": 0.0, "power_exponent": 0.0}, seconds=120)
    np.testing.assert_array_equal(beside["pump1_power_kw"], alone["pump1_power_kw"])
    halves, whole = run(quiet_alpha, slips, slips, seconds=120), run(quiet_alpha, slips | {"slip": 0.1}, seconds=120)
    np.testing.assert_allclose(halves["pump1_power_kw"], whole["pump1_power_kw"], rtol=1e-12)


def test_ramp_shape_of_a_power(quiet_alpha):
    rows = run(quiet_alpha, {"name": "ramp_shape", "power": 2.0}, seconds=400)
    commanded = rows["pump1_frequency_hz"] / NOMINAL_HZ
    assert np.sum((commanded > 0) & (commanded < 1)) >= 15
    np.testing.assert_allclose(speeds_of(rows), commanded**2, atol=1e-9)


def test_ramp_shape_of_two_slopes(quiet_alpha):
    """A drive that is at half speed after a tenth of its ramp."""
    knee, at_knee = 0.1, 0.5
    ahead = (at_knee - knee) / (1.0 - knee)
    rows = run(quiet_alpha, {"name": "ramp_shape", "ahead": ahead, "knee": knee}, seconds=400)
    commanded = rows["pump1_frequency_hz"] / NOMINAL_HZ
    assert np.sum((commanded > 0) & (commanded < 1)) >= 15
    np.testing.assert_allclose(speeds_of(rows), np.interp(commanded, [0, knee, 1], [0, at_knee, 1]), atol=1e-9)


def test_ramp_shape_of_a_lag(quiet_alpha):
    """The command holds for a second, so that the exponential step is exact."""
    lag_s = 4.0
    rows = run(quiet_alpha, {"name": "ramp_shape", "lag_s": lag_s}, seconds=500)
    speed, expected = 0.0, []
    for commanded in rows["pump1_frequency_hz"] / NOMINAL_HZ:
        step = solve_ivp(lambda _t, n, c=commanded: (c - n) / lag_s, (0, 1), [speed], rtol=1e-10, atol=1e-12)
        speed = step.y[0, -1]
        expected.append(speed)
    seen = rows["pump1_frequency_hz"] > 0
    np.testing.assert_allclose(speeds_of(rows)[seen], np.array(expected)[seen], atol=EXACT)
    after = first_run(rows).stop
    assert rows["truth_pump1_flow_m3h"][after] > 0


@pytest.mark.parametrize("delay_s", [20.0, 37.5])
def test_control_delay_overshoots_by_delay_times_slope(quiet_alpha, delay_s):
    plain = run(quiet_alpha, level_m=1.0)
    late = run(quiet_alpha, {"name": "control_delay", "delay_s": delay_s}, level_m=1.0)
    slope_m_s = 91.0 / 3600.0 / AREA_M2
    begin, begin_late = first_run(plain).start, first_run(late).start
    assert begin_late - begin in {math.floor(delay_s), math.ceil(delay_s)}
    overshoot_m = late["level_m"][begin_late] - plain["level_m"][begin]
    assert overshoot_m == pytest.approx(delay_s * slope_m_s, abs=slope_m_s)
    fall_m_s = (duty_m3h() - 91.0) / 3600.0 / AREA_M2
    undershoot_m = plain["level_m"].min() - late["level_m"][: begin_late + 500].min()
    assert undershoot_m == pytest.approx(delay_s * fall_m_s, abs=1.5 * fall_m_s)


@pytest.mark.parametrize(("start_m", "stop_m"), [(0.15, 0.0), (0.0, 0.2), (-0.3, -0.2)])
def test_threshold_shift(quiet_alpha, start_m, stop_m):
    """A level is acted on in the scan that sees it, and the frequency shows one second later."""
    rows = run(quiet_alpha, {"name": "threshold_shift", "start_m": start_m, "stop_m": stop_m}, level_m=1.0)
    begin = first_run(rows).start
    rise_m = 91.0 / 3600.0 / AREA_M2
    assert 1.6 + start_m <= rows["level_m"][begin - 1] < 1.6 + start_m + rise_m
    frequency_hz = rows["pump1_frequency_hz"]
    stop = begin + 20 + int(np.argmax(np.diff(frequency_hz[begin + 20 :]) < 0))
    fall_m = (duty_m3h() - 91.0) / 3600.0 / AREA_M2
    assert 0.5 + stop_m - fall_m < rows["level_m"][stop] <= 0.5 + stop_m


def test_level_sensor_lag_and_the_controller_sees_it(quiet_alpha):
    lag_s = 20.0
    rows = run(quiet_alpha, {"name": "level_sensor_lag", "lag_s": lag_s}, level_m=1.0)
    begin = first_run(rows).start
    slope_m_s = 91.0 / 3600.0 / AREA_M2
    time_s = np.arange(begin)
    ramp = solve_ivp(lambda t, y: (1.0 + slope_m_s * t - y) / lag_s, (0, begin), [1.0], t_eval=time_s, rtol=1e-9)
    np.testing.assert_allclose(rows["level_m"][:begin], ramp.y[0], rtol=0, atol=slope_m_s)
    assert rows["level_m"][begin - 1] >= 1.6 > rows["level_m"][begin - 2]
    assert rows["truth_level_m"][begin] == pytest.approx(1.6 + slope_m_s * lag_s, abs=2 * slope_m_s)


def test_level_quantisation_is_a_lattice_that_the_controller_does_not_see(quiet_alpha):
    quantum_m = 0.05
    rows, plain = run(quiet_alpha, {"name": "level_quantisation", "quantum_m": quantum_m}), run(quiet_alpha)
    steps = rows["level_m"] / quantum_m
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.max(np.abs(rows["level_m"] - plain["level_m"])) <= quantum_m / 2 + 1e-12
    np.testing.assert_array_equal(rows["truth_level_m"], plain["level_m"])


def test_flow_meter_gain(quiet_alpha):
    rows, plain = run(quiet_alpha, {"name": "flow_meter_gain", "factor": 1.12}), run(quiet_alpha)
    np.testing.assert_allclose(rows["pump1_flow_m3h"], 1.12 * plain["pump1_flow_m3h"], rtol=1e-12)
    for column in ("level_m", "inflow_m3h", "pump1_head_m", "truth_pump1_flow_m3h"):
        np.testing.assert_array_equal(rows[column], plain[column])


def test_power_meter_gain(quiet_alpha):
    rows, plain = run(quiet_alpha, {"name": "power_meter_gain", "factor": 0.88}), run(quiet_alpha)
    np.testing.assert_allclose(rows["pump1_power_kw"], 0.88 * plain["pump1_power_kw"], rtol=1e-12)
    for column in ("level_m", "inflow_m3h", "pump1_flow_m3h", "pump1_head_m", "truth_pump1_power_kw"):
        np.testing.assert_array_equal(rows[column], plain[column])


def test_flow_meter_lag(quiet_alpha):
    """Against the ODE under the true flow, which moves evenly over each second."""
    lag_s = 8.0
    rows = run(quiet_alpha, {"name": "flow_meter_lag", "lag_s": lag_s}, seconds=450)
    reading, expected = 0.0, []
    for last, flow in pairwise(np.r_[0.0, rows["truth_pump1_flow_m3h"]]):
        step = solve_ivp(
            lambda t, y, last=last, flow=flow: (last + (flow - last) * t - y) / lag_s,
            (0, 1),
            [reading],
            rtol=1e-9,
            atol=1e-9,
        )
        reading = step.y[0, -1]
        expected.append(reading)
    np.testing.assert_allclose(rows["pump1_flow_m3h"], expected, atol=1e-5)
    stop = first_run(rows).stop
    assert rows["truth_pump1_flow_m3h"][stop + 5] == 0
    assert rows["pump1_flow_m3h"][stop + 5] > 10


@pytest.mark.parametrize("second_share", [0.02, 0.2, 0.5])
def test_lags_of_two_filters_in_a_row(quiet_alpha, second_share):
    """Against the two ODEs under the true flow and level, which move evenly over each second."""
    lag_s = 8.0
    times_s = (1.0 - second_share) * lag_s, second_share * lag_s
    effects = [
        {"name": name, "lag_s": lag_s, "second_share": second_share}
        for name in ("flow_meter_lag", "level_sensor_lag")
    ]
    rows = run(quiet_alpha, *effects, seconds=450)
    for true, read, tolerance in (
        ("truth_pump1_flow_m3h", "pump1_flow_m3h", 1e-5),
        ("truth_level_m", "level_m", 1e-3),
    ):
        filtered, expected = [rows[read][0]] * 2, []
        for last, value in pairwise(np.r_[rows[true][0], rows[true]]):
            both = solve_ivp(
                lambda t, x, last=last, value=value: (
                    (last + (value - last) * t - x[0]) / times_s[0],
                    (x[0] - x[1]) / times_s[1],
                ),
                (0, 1),
                filtered,
                rtol=1e-9,
                atol=1e-9,
            )
            filtered = both.y[:, -1]
            expected.append(filtered[1])
        np.testing.assert_allclose(rows[read], expected, atol=tolerance)


def test_flow_low_cutoff(quiet_alpha):
    rows, plain = run(quiet_alpha, {"name": "flow_low_cutoff", "cutoff_m3h": 80.0}), run(quiet_alpha)
    flow_m3h = plain["pump1_flow_m3h"]
    assert np.any((flow_m3h > 0) & (flow_m3h < 80.0))
    np.testing.assert_array_equal(rows["pump1_flow_m3h"], np.where(flow_m3h < 80.0, 0.0, flow_m3h))


def test_head_sensor_offset_only_while_the_pump_runs(quiet_alpha):
    rows, plain = run(quiet_alpha, {"name": "head_sensor_offset", "offset_m": -1.3}), run(quiet_alpha)
    running = plain["pump1_frequency_hz"] > 0
    np.testing.assert_allclose(rows["pump1_head_m"][running], plain["pump1_head_m"][running] - 1.3, atol=1e-12)
    assert not rows["pump1_head_m"][~running].any()


@pytest.mark.parametrize("channel", ["level_m", "pump1_flow_m3h", "pump1_frequency_hz", "inflow_m3h"])
@pytest.mark.parametrize("delay_s", [17.0, 2.5])
def test_channel_delay_is_a_pure_shift(quiet_alpha, channel, delay_s):
    """Between whole seconds it is the mean of the two readings around."""
    effect = {"name": "channel_delay", "channel": channel.removeprefix("pump1_"), "delay_s": delay_s}
    rows, plain = run(quiet_alpha, effect), run(quiet_alpha)
    time_s = np.arange(900.0)
    shifted = np.interp(time_s - delay_s, time_s, plain[channel])
    np.testing.assert_allclose(rows[channel][120:], shifted[120:], atol=1e-9)
    np.testing.assert_array_equal(rows["truth_level_m"], plain["truth_level_m"])


@pytest.mark.parametrize(("channel", "deadband"), [("level_m", 0.04), ("flow_m3h", 35.0)])
def test_report_by_exception_repeats_until_the_deadband_is_reached(quiet_alpha, channel, deadband):
    rows = run(quiet_alpha, {"name": "report_by_exception", "channel": channel, "deadband": deadband})
    column = channel if channel == "level_m" else f"pump1_{channel}"
    true_values = rows["truth_level_m"] if channel == "level_m" else rows[f"truth_pump1_{channel}"]
    steps = np.abs(np.diff(rows[column]))
    assert np.all((steps == 0) | (steps >= deadband - 1e-12))
    assert 3 <= np.sum(steps > 0) < 100
    assert np.max(np.abs(rows[column] - true_values)) < deadband
    changed = np.flatnonzero(steps) + 1
    np.testing.assert_array_equal(rows[column][changed], true_values[changed])


def test_load_dependent_power(quiet_alpha):
    """At the duty point by hand, and rising with the flow of one speed."""
    flow_m3h = duty_m3h()
    hydraulic_kw = 9.81 * flow_m3h / 3600.0 * head_m(1.0, flow_m3h)
    shaft_kw = hydraulic_kw / 0.9
    followed_kw = math.sqrt(3.0) * 400.0 * 30.0 * 0.9 / 1000.0
    effect = {"name": "load_dependent_power", "share": 0.7, "shutoff_share": 0.3, "rated_factor": 1.1}
    rows = run(quiet_alpha, effect)
    expected = 0.3 * followed_kw + 0.7 * 1.1 * shaft_kw / (0.92 * 0.97)
    np.testing.assert_allclose(rows["pump1_power_kw"][steady(rows)], expected, rtol=1e-9)
    powers, flows = [], []
    for offset_m in (-1.0, 3.0, 8.0, 15.0):
        rows = run(quiet_alpha, {"name": "static_head_bias", "offset_m": offset_m}, effect, seconds=60)
        powers.append(rows["pump1_power_kw"][-1])
        flows.append(rows["pump1_flow_m3h"][-1])
    assert np.all(np.diff(flows) < 0)
    assert np.all(np.diff(powers) < 0)
    plain = run(quiet_alpha, seconds=60)
    np.testing.assert_array_equal(run(quiet_alpha, effect, seconds=60)["pump1_flow_m3h"], plain["pump1_flow_m3h"])


def test_supply_voltage_variation_is_seen_in_the_power_alone(quiet_alpha):
    effect = {
        "name": "supply_voltage_variation",
        "daily_amplitude": 0.06,
        "daily_phase_h": 3.0,
        "fast_amplitude": 0.02,
        "fast_period_s": 70.0,
    }
    rows, plain = run(quiet_alpha, effect, seconds=3000), run(quiet_alpha, seconds=3000)
    time_s = np.arange(3000.0)
    daily = 0.06 * np.cos(2 * np.pi * (time_s - 3 * 3600.0) / 86_400.0)
    expected = plain["pump1_power_kw"] * (1 + daily + 0.02 * np.sin(2 * np.pi * time_s / 70.0))
    np.testing.assert_allclose(rows["pump1_power_kw"], expected, rtol=1e-12)
    for column in set(plain) - {f"{truth}pump{i}_power_kw" for truth in ("", "truth_") for i in (1, 2, 3)}:
        assert plain[column].tobytes() == rows[column].tobytes(), column
