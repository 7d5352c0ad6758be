"""EPA SWMM 5 as a truth plant against the fine-step plant: two programs, one station.

Tolerances: friction after Colebrook for a length that fits k at the rated flow, 0.3 % of the duty, 1 % where the duty
lies elsewhere; drives move in steps of half a second and the mains have an inertance of 190 s²/m², which moves a
switching by some seconds: one start of two hours, 5 % of the mean flow of one pump.
"""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.services.trial.swmm_plant import run_swmm
from wetwell.sim2real.trial.families import FAMILIES
from wetwell.sim2real.truth import truth_plant
from wetwell.sim2real.truth.case import Deviation, TrueInflow, TruthCase
from wetwell.sim2real.truth.swmm_input import SWMM_LIBRARY

pytestmark = pytest.mark.long

pytest.importorskip("pyswmm", reason="pyswmm has no build for this platform", exc_type=ImportError)


def both(station, *deviations, mean_m3h=90.0, seconds=7200):
    inflow = TrueInflow(mean_m3h=mean_m3h, swing=0.0, noise=0.0, rain_per_day=0.0)
    case = TruthCase(station=station, deviations=deviations, inflow=inflow, seconds=seconds)
    return run_swmm(case).columns, truth_plant.run(case).columns


def settled(columns, pumps, count):
    """Seconds in which `count` pumps have run at nominal speed for 20 s."""
    at_nominal = sum(columns[f"pump{i}_frequency_hz"] == 50.0 for i in range(1, pumps + 1))
    running = sum(columns[f"pump{i}_running"] for i in range(1, pumps + 1))
    still = (at_nominal == count) & (running == count)
    return np.convolve(still, np.ones(20), "full")[: still.size] >= 20


def duty(columns, count):
    numbers = [i for i in (1, 2, 3) if f"pump{i}_running" in columns]
    at = settled(columns, len(numbers), count)
    assert at.any()
    running = [at & (columns[f"pump{i}_running"] > 0) for i in numbers]
    return tuple(
        np.mean(np.concatenate([columns[f"pump{i}_{name}"][its] for i, its in zip(numbers, running, strict=True)]))
        for name in ("flow_m3h", "head_m")
    )


def test_two_hours_of_the_plain_station(quiet_alpha):
    swmm, fine = both(quiet_alpha)
    assert duty(swmm, 1) == pytest.approx(duty(fine, 1), rel=3e-3)
    starts, fine_starts = (
        sum((np.diff(columns[f"pump{i}_running"]) > 0).sum() for i in (1, 2, 3)) for columns in (swmm, fine)
    )
    assert abs(int(starts) - int(fine_starts)) <= 1
    for i in (1, 2, 3):
        assert swmm[f"pump{i}_flow_m3h"].mean() == pytest.approx(fine[f"pump{i}_flow_m3h"].mean(), rel=0.05)
    assert swmm["level_m"].max() == pytest.approx(fine["level_m"].max(), abs=0.01)
    idle = sum(swmm[f"pump{i}_running"] for i in (1, 2, 3)) == 0
    assert all(np.all(swmm[f"pump{i}_head_m"][idle] == 0.0) for i in (1, 2, 3))


@pytest.mark.parametrize("shared", [0.7, 1.0])
def test_two_pumps_on_a_header(shared, quiet_alpha):
    header = Deviation(name="common_header", parameters={"shared_fraction": shared})
    swmm, fine = both(quiet_alpha, header, mean_m3h=205.0)
    for count in (1, 2):
        assert duty(swmm, count) == pytest.approx(duty(fine, count), rel=1e-2)


@pytest.mark.parametrize(
    "deviation",
    [
        Deviation(name="friction_bias", parameters={"factor": 1.4, "smoothness": 0.0}),
        Deviation(name="static_head_bias", parameters={"offset_m": 3.0}),
        Deviation(name="pump_wear", parameters={"head_loss": 0.1, "pump": 0}),
        Deviation(name="pump_wear", parameters={"ring_m3h": 20.0, "duty_head_m": 27.0, "pump": 0}),
    ],
    ids=lambda deviation: deviation.name,
)
def test_the_duty_moves_alike(deviation, quiet_alpha):
    plain, _ = both(quiet_alpha, seconds=3600)
    swmm, fine = both(quiet_alpha, deviation, seconds=3600)
    assert duty(swmm, 1) == pytest.approx(duty(fine, 1), rel=1e-2)
    assert abs(duty(swmm, 1)[0] / duty(plain, 1)[0] - 1.0) > 0.02


def test_the_area_at_the_floor_speeds_up_the_level(quiet_alpha):
    cone = Deviation(name="sump_area_profile", parameters={"bottom_factor": 0.4, "height_m": 1.5})
    swmm, fine = both(quiet_alpha, cone)
    for columns in (swmm, fine):
        rises = np.diff(columns["level_m"]) * 3600.0 / 90.0
        idle = sum(columns[f"pump{i}_running"] for i in (1, 2, 3))[1:] == 0
        level_m = columns["level_m"][1:]
        root = np.sqrt(0.4)
        area_m2 = 8.0 * (root + (1 - root) * np.minimum(level_m / 1.5, 1.0)) ** 2
        before = np.convolve(~idle, np.ones(4), "full")[: idle.size] > 0  # water runs out after the command
        np.testing.assert_allclose((rises * area_m2)[~before][5:], 1.0, atol=0.02)


def test_no_friction_is_lost_where_two_pumps_drive_the_water_fastest(quiet_alpha):
    """The mains of seed 126 would be the only ones of 400 that are too narrow if they were made for one pump."""
    rng = np.random.default_rng(126)
    drawn = FAMILIES["swmm"].case_of((), "fast", rng, seconds=3600, slow_share=0.0, every_s=1)
    case = replace(
        drawn,
        station=drawn.station.model_copy(update={"sensors": quiet_alpha.sensors}),
        inflow=replace(drawn.inflow, mean_m3h=400.0, swing=0.0, noise=0.0, rain_per_day=0.0),
    )
    assert duty(run_swmm(case).columns, 2) == pytest.approx(duty(truth_plant.run(case).columns, 2), rel=4e-3)


def test_all_deviations_for_swmm_exist():
    assert {"friction_bias", "static_head_bias", "sump_area_profile", "common_header"} <= set(SWMM_LIBRARY)
    assert set(SWMM_LIBRARY) <= set(truth_plant.DEVIATIONS)
