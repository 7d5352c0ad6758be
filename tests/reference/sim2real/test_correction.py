"""Corrections of recordings of another plant with a deviation that the library does not hold: learnt and run with."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.station.station_file import load_station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.batch.field_data import write_station
from wetwell.services.reports.gap.page import gap_page
from wetwell.services.reports.gap.terminal import gap_lines
from wetwell.sim2real.correction.learning import learn
from wetwell.sim2real.correction.selection import Proposal
from wetwell.sim2real.correction.target import targets_of
from wetwell.sim2real.correction.workshop import Workshop, effect_of
from wetwell.sim2real.diagnosis.correction import weighed
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.diagnosis.shrinkage import gap_of
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import asinh_loss
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.sim2real.truth.case import Deviation
from wetwell.sim2real.truth.sampling import case_of
from wetwell.sim2real.truth.truth_plant import run
from wetwell.simulator.effects import effects_of
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOURS_S = 43_200


def truth(name, seed, **parameters):
    rng = np.random.default_rng(seed)
    case = case_of((name,) if name else (), "s", rng, seconds=HOURS_S)
    return replace(case, deviations=(Deviation(name=name, parameters=parameters),)) if parameters else case


def residuals_of(recording, station):
    traces = traces_of(recording, station)
    replay = Replay(traces, station, effects_of(station))
    regimes = regimes_of(traces, station)
    return replay, StationResiduals(traces, station, regimes, replay.run(), replay.doubt)


@pytest.fixture(scope="module")
def drifting():
    return truth("flow_meter_drift", 970_931, drift=0.15, turns=2.0)


@pytest.fixture(scope="module")
def diagnosis(drifting):
    return diagnose(run(drifting, truth=False), drifting.station, only=["flow_meter_lag"])


def test_a_drift_that_nobody_named_gets_its_equation(diagnosis):
    report = diagnosis.report()
    assert report.verdict == "unknown"
    assert report.effects == ()
    found = report.correction
    assert (found.term, found.component) == ("flow_reading", "flow_meter")
    assert set(found.covariates) <= {"days", "hour_of_day"}
    assert found.equation.startswith("flow_reading × (1 ")
    assert "look for" in found.sentence
    assert found.shrinkage > 0.9
    assert f"it closes {found.shrinkage:.1%} (" in gap_lines(report, Path("diagnosis"))
    swing = max(found.addends, key=lambda addend: abs(addend.size) * (addend.shape is not None))
    assert swing.ci[0] < swing.size < swing.ci[1]


@pytest.mark.parametrize(
    ("library", "answer"),
    [(("static_head_bias", "flow_meter_gain"), "unknown"), (("friction_bias", "static_head_bias"), "effect")],
)
def test_a_friction_that_the_library_lacks_is_no_lift(library, answer):
    """A lift comes near, and far nearer than any discrepancy of the readings: a correction of the losses is right."""
    rough = truth("friction_bias", 970_941, factor=0.75, smoothness=0.2)
    told = diagnose(run(rough, truth=False), rough.station, only=library)
    assert told.verdict == answer
    assert [effect.name for effect in told.effects] == (["friction_bias"] if answer == "effect" else [])


def test_the_page_shows_equation_and_residuals_against_what_it_goes_by(diagnosis):
    page = gap_page(diagnosis.report(), diagnosis)
    assert "An equation for what nobody has named" in page
    assert "with the correction" not in page or "without the correction" in page
    for covariate in diagnosis.correction.report.covariates:
        assert f"residual of the flow against {covariate}" in page


def test_a_fresh_recording_is_nearer_with_it_and_nothing_is_left_to_learn(diagnosis, drifting, tmp_path):
    write_station(diagnosis.station, tmp_path / "station.toml")
    station = load_station(tmp_path / "station.toml")
    (effect,) = effects_of(station)
    assert effect == diagnosis.correction.learnt.effect
    fresh = run(replace(drifting, seed=drifting.seed + 1), truth=False)
    replay, residuals = residuals_of(fresh, drifting.station)
    before, after = (float(np.mean(np.arcsinh(residuals.of(replay.run(own))) ** 2)) for own in ((), (effect,)))
    right = float(np.mean(np.arcsinh(residuals.of(replay.run())[residuals.bins.signal != 0]) ** 2))
    assert before > 2.0 * after
    assert after < 1.5 * right
    again, left = residuals_of(fresh, station)
    assert weighed(learn(again, left), left.bins, again.run().plant, np.random.default_rng(0))[0] is None
    assert Simulation(station, Scenario(name="s"), seed=1).advance(600).columns["level_m"].size == 600


@pytest.mark.parametrize(("vortex_m", "seed"), [(8.0, 970_971), (12.0, 970_971), (12.0, 970_972)])
def test_what_is_told_closes_as_much_as_is_said_of_it(vortex_m, seed):
    """Also where the first guess, along a straight line, would leave the pump no head."""
    case = truth("inlet_vortex", seed, vortex_m=vortex_m, submergence_m=1.6)
    replay, residuals = residuals_of(run(case, truth=False), case.station)
    taken, why = weighed(learn(replay, residuals), residuals.bins, replay.run().plant, np.random.default_rng(0))
    assert why is None
    everything = np.ones(residuals.bins.size, dtype=bool)
    losses = (asinh_loss(residuals.of(replay.run(own))) for own in ((), (taken.learnt.effect,)))
    told = gap_of(*losses, residuals.bins, everything, np.random.default_rng(0))
    assert told.shrinkage > 0.8
    assert told.shrinkage == pytest.approx(taken.report.shrinkage, abs=0.05)


def test_a_size_at_its_end_is_probed_the_other_way():
    """A little more lift than this, and no pump of the station would lift it."""
    case = truth(None, 970_941)
    replay, residuals = residuals_of(run(case, truth=False), case.station)
    shop = Workshop(replay, residuals)
    target = next(one for one in targets_of(replay.run().plant) if one.term == "static_head")
    most = max(size for size in np.arange(0.0, 2.0, 0.004) if bears(replay, float(size)))
    last = Proposal(target=target, atoms=(), sizes=np.array([most]), log=0.0)
    slopes = shop.slopes(last, shop.under(effect_of(last)))
    lower = replace(last, sizes=last.sizes - 0.05)
    assert np.any(slopes != 0.0)
    again = shop.slopes(lower, shop.under(effect_of(lower)))
    assert np.sum(slopes * again) > 0.5 * np.sum(again**2)


def bears(replay, size):
    try:
        replay.run([LearntCorrection(term="static_head", offset=size)])
    except ValueError:
        return False
    return True


def test_residuals_far_off_are_not_alike():
    """An offset must not pay by driving all residuals to where the loss is flat."""
    case = truth(None, 970_941)
    replay, residuals = residuals_of(run(case, truth=False), case.station)
    shop = Workshop(replay, residuals)
    near = shop.plain + np.random.default_rng(1).normal(0.0, 3.0, shop.plain.size)
    for off in (near, near + 10.0, near + 100.0):
        assert np.std(shop.bounded(off)) == pytest.approx(np.std(shop.bounded(near)), rel=1e-6)


def test_a_head_and_a_speed_of_a_pump_are_not_told_apart():
    """At one speed the affinity laws make the same of both; a friction is something else."""
    case = truth("inlet_vortex", 970_971, vortex_m=8.0, submergence_m=1.6)
    replay, residuals = residuals_of(run(case, truth=False), case.station)
    taken, _ = weighed(learn(replay, residuals), residuals.bins, replay.run().plant, np.random.default_rng(0))
    told = {taken.report.term, *(one.term for one in taken.report.equivalent)}
    assert told == {"pump_head", "speed"}
    assert {one.component for one in (taken.report, *taken.report.equivalent)} == {"pump", "drive"}
    both = (taken.learnt.effect, *taken.learnt.equivalent)
    one, other = (residuals.of(replay.run([effect])) for effect in both)
    plain = residuals.of(replay.run())
    assert np.mean((one - other) ** 2) < 0.01 * np.mean((plain - one) ** 2)


def test_what_takes_another_signal_further_off_is_not_taken():
    """A flow that comes late would be nearer with a static head that is higher at first, which the head denies."""
    case = truth(None, 970_981)
    recording = run(case, truth=False)
    late = {
        name: np.r_[np.zeros(60), values[:-60]] if name.endswith("_flow_m3h") else values
        for name, values in recording.columns.items()
    }
    replay, residuals = residuals_of(replace(recording, columns=late), case.station)
    shop = Workshop(replay, residuals)
    start = {"covariate": "since_start_s", "shape": "decay", "scale": 60.0, "low": 0.0, "high": 600.0}
    static = LearntCorrection.model_validate({"term": "static_head", "part": [start | {"size": 0.5}]})
    reading = LearntCorrection.model_validate({"term": "flow_reading", "part": [start | {"size": -0.9}]})
    assert shop.spoils(shop.under(static))
    assert not shop.spoils(shop.under(reading))


def test_a_change_within_the_recording_is_told_with_its_time():
    """And not as a swing that is longer than the recording."""
    case = truth(None, 970_991)
    recording = run(case, truth=False)
    is_after = recording.time_ns >= recording.time_ns[0] + 25_000 * NS_PER_S
    columns = {
        name: np.where(is_after, 1.08, 1.0) * values if name.endswith("_flow_m3h") else values
        for name, values in recording.columns.items()
    }
    replay, residuals = residuals_of(replace(recording, columns=columns), case.station)
    taken, _ = weighed(learn(replay, residuals), residuals.bins, replay.run().plant, np.random.default_rng(0))
    (part,) = taken.learnt.effect.part
    assert (taken.report.term, part.covariate, part.shape) == ("flow_reading", "days", "step")
    assert part.size == pytest.approx(0.08, abs=0.01)
    when_s = part.centre * 86_400 - int(recording.time_ns[0]) / NS_PER_S
    assert when_s == pytest.approx(25_000, abs=HOURS_S / 100)
    assert "for good: look for what was done or broke then" in taken.report.sentence


@pytest.mark.parametrize("quantity", ["flow_m3h", "power_kw"])
def test_what_only_one_pump_has_is_told_of_it(quantity):
    """A meter of the second pump follows the level; that of the first one is right."""
    case = next(case for seed in range(971_010, 971_100) if len((case := truth(None, seed)).station.pump) > 1)
    recording = run(case, truth=False)
    level_m = recording.columns["level_m"]
    name = f"pump2_{quantity}"
    factor = 1.0 + 0.3 * (level_m - np.nanmean(level_m)) / np.nanmean(level_m)
    replay, residuals = residuals_of(
        replace(recording, columns=dict(recording.columns) | {name: factor * recording.columns[name]}), case.station
    )
    taken, why = weighed(learn(replay, residuals), residuals.bins, replay.run().plant, np.random.default_rng(0))
    assert why is None
    assert (taken.report.term, taken.report.pump) == ({"flow_m3h": "flow_reading", "power_kw": "power"}[quantity], 2)
    assert taken.report.equation.startswith(f"{taken.report.term} of pump 2 × (1 ")
    assert "of pump 2" in taken.report.sentence


@pytest.mark.parametrize("seed", [970_941, 970_942])
def test_a_truth_as_its_file_says_gets_none(seed):
    case = truth(None, seed)
    replay, residuals = residuals_of(run(case, truth=False), case.station)
    taken, why = weighed(learn(replay, residuals), residuals.bins, replay.run().plant, np.random.default_rng(0))
    assert taken is None
    assert why.startswith("no correction")


def test_a_cause_that_nothing_goes_with_gets_none():
    """Foam comes when it likes."""
    case = truth("foam", 970_951, foam_m=0.2, foam_s=300.0)
    replay, residuals = residuals_of(run(case, truth=False), case.station)
    taken, why = weighed(learn(replay, residuals), residuals.bins, replay.run().plant, np.random.default_rng(0))
    assert taken is None
    assert "\n" not in why


RISE_PER_MM_H = 0.02
"""Of the reading of the flow meters, as rain makes it."""


def rained(seed, rain_mm_h, noise_mm_h):
    """A station whose flow meters read more in rain, which a gauge of its own measures with errors."""
    case = truth(None, seed)
    recording = run(case, truth=False)
    columns = {
        name: values * (1.0 + RISE_PER_MM_H * (rain_mm_h - 5.0)) if name.endswith("_flow_m3h") else values
        for name, values in recording.columns.items()
    }
    errors = np.random.default_rng([1, seed]).normal(0.0, noise_mm_h, HOURS_S)
    return case.station, replace(recording, columns={**columns, "covariate_rain_mm_h": rain_mm_h + errors})


def rain_that_wanders(rng):
    return 5.0 + 3.0 * np.sin(np.arange(HOURS_S) / 4000.0) + 0.02 * np.cumsum(rng.normal(size=HOURS_S))


def rain_that_jumps(rng):
    return np.repeat(rng.uniform(0.0, 10.0, HOURS_S // 900), 900)


@pytest.mark.parametrize(
    ("rain", "noise_mm_h", "told_mm_h"),
    [(rain_that_wanders, 0.0, 0.0), (rain_that_wanders, 3.0, 3.0), (rain_that_jumps, 0.0, 0.0)],
)
def test_errors_of_a_column_do_not_make_its_slope_too_small(rain, noise_mm_h, told_mm_h):
    """A gauge without errors whose rain jumps looks as if it had some: the recording says that it has none."""
    station, recording = rained(970_961, rain(np.random.default_rng(970_961)), noise_mm_h)
    replay, residuals = residuals_of(recording, station)
    taken, why = weighed(learn(replay, residuals), residuals.bins, replay.run().plant, np.random.default_rng(0))
    assert why is None
    effect = taken.learnt.effect
    (part,) = effect.part
    assert (effect.term, part.column, part.shape) == ("flow_reading", "rain_mm_h", "linear")
    assert part.noise == pytest.approx(told_mm_h, rel=0.05)
    assert part.size / part.scale == pytest.approx(RISE_PER_MM_H, rel=0.05)
    assert ("errors of ±3" in taken.report.sentence) == (told_mm_h > 0.0)
