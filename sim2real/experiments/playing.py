"""An act as it would go: played on the simulator under a set of effects, with what it moves and what it breaks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.orders import Step
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.attribution.possible import PossibleSet
from wetwell.sim2real.experiments.act import BRIM_SHARE, Act, Site
from wetwell.sim2real.experiments.conditions import Conditions
from wetwell.sim2real.recording.rows import MIN_LENGTH_S
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.inflow.surges import Surges
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

AFTERWARDS_S = 300
"""Time that is recorded after an act, for what it leaves behind. [s]"""
HOUR_S = 3600
DRY_SHARE = 0.02
"""Share of the largest flow of a pump under which it moves no water. [1]"""
LONGEST_DRY_S = 90
"""Longest time for which a pump may turn without moving water: it warms up. [s]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """An act that was played.

    Attributes
    ----------
    recording : Recording
        Each second of it, with noise and with the truth.
    moved_m3 : float
        Water that was pumped by hand, or held back in the sewer. [m³]
    extra_kwh : float
        Energy beyond what the controller would take for the same water. [kWh]
    length_h : float
        Until the controller is alone again. [h]
    broken : str
        Why it may not be done; empty where it may.
    """

    recording: Recording
    moved_m3: float
    extra_kwh: float
    length_h: float
    broken: str


def play(act: Act, site: Site, station: Station, possible: PossibleSet, conditions: Conditions, seed: int) -> Played:
    """Play an act.

    Parameters
    ----------
    act : Act
    site : Site
    station : Station
        As it was believed before the diagnosis.
    possible : PossibleSet
        What acts beside it.
    conditions : Conditions
    seed : int
        Of the noise.

    Raises
    ------
    ValueError
        If the effects do not fit the station.
    """
    longest_s = math.ceil(sum(step.longest_s for step in act.steps)) + AFTERWARDS_S + MIN_LENGTH_S
    whole = simulated(site, station, possible, conditions, seed, longest_s, act.steps)
    is_by_hand = whole.column("by_hand") > 0.0
    ended_s = int(np.flatnonzero(is_by_hand)[-1]) + 1
    recording = _first(whole, max(ended_s + AFTERWARDS_S, MIN_LENGTH_S + 1))
    flow_m3h, power_kw = (_total(whole, quantity) for quantity in ("flow_m3h", "power_kw"))
    held_back_m3h = conditions.inflow_m3h * (whole.column("inlet_open") <= 0.0)
    alone = simulated(site, station, possible, conditions, seed, longest_s)
    kwh_m3 = _total(alone, "power_kw").sum() / max(_total(alone, "flow_m3h").sum(), 1e-9)
    pumped_m3 = float(flow_m3h[is_by_hand].sum()) / HOUR_S
    return Played(
        recording=recording,
        moved_m3=pumped_m3 + float(held_back_m3h.sum()) / HOUR_S,
        extra_kwh=float(power_kw[is_by_hand].sum()) / HOUR_S - pumped_m3 * float(kwh_m3),
        length_h=ended_s / HOUR_S,
        broken=_broken(recording, site, station, conditions.inflow_m3h),
    )


def simulated(
    site: Site,
    station: Station,
    possible: PossibleSet,
    conditions: Conditions,
    seed: int,
    seconds: int,
    steps: Sequence[Step] = (),
) -> Recording:
    """Each second of a station on which a set of effects acts, with the truth; parameters as of `play`."""
    tables = tuple(EffectTable.model_validate(effect.model_dump()) for effect in possible.effects)
    changed = station.model_copy(update={"effect": (*station.effect, *tables)})
    scenario = Scenario(
        name="act",
        initial_level_m=0.5 * (site.stop_m + station.control.start_levels_m[0]),
        inflow=DiurnalInflow(
            mean_m3h=conditions.inflow_m3h, amplitude_m3h=0.0, noise_m3h=0.0, surges=Surges(flow_m3h=0.0)
        ),
    )
    return Simulation(changed, scenario, seed, start_ns=0 if steps else -seconds * NS_PER_S, steps=steps).advance(
        seconds
    )


def _first(recording: Recording, seconds: int) -> Recording:
    return Recording(
        time_ns=recording.time_ns[:seconds],
        columns={name: values[:seconds] for name, values in recording.columns.items()},
        truth={name: values[:seconds] for name, values in recording.truth.items()},
        station=recording.station,
    )


def _total(recording: Recording, quantity: str) -> Floats:
    """(n,) true sum over the pumps."""
    rows = [recording.truth[f"truth_pump{i}_{quantity}"] for i in range(1, recording.pumps + 1)]
    return np.asarray(np.sum(rows, axis=0), dtype=np.float64)


def _broken(recording: Recording, site: Site, station: Station, inflow_m3h: float) -> str:
    """The first rule that an act breaks."""
    return _broken_by_level(recording, site, station, inflow_m3h) or _broken_by_pumps(recording, station)


def _broken_by_level(recording: Recording, site: Site, station: Station, inflow_m3h: float) -> str:
    level_m = recording.truth["truth_level_m"]
    runs = np.any([recording.column(f"pump{i}_frequency_hz") > 0.0 for i in range(1, recording.pumps + 1)], axis=0)
    if np.any(runs & (recording.column("by_hand") > 0.0) & (level_m >= site.high_m)):
        return f"what runs does not carry {inflow_m3h:.4g} m³/h: wait until less comes in"
    if np.any(recording.truth["truth_overflow_m3h"] > 0.0):
        return "the wet well overflows"
    most_m = site.high_m + BRIM_SHARE * (site.high_m - site.stop_m)
    if station.sump.overflow_level_m is None and level_m.max() > most_m:
        return f"the level rises to {level_m.max():.2f} m, more than {most_m:.2f} m"
    least_m = site.low_m - BRIM_SHARE * (site.high_m - site.stop_m)
    if level_m.min() < least_m:
        return f"the level falls to {level_m.min():.2f} m, under {least_m:.2f} m"
    return ""


def _broken_by_pumps(recording: Recording, station: Station) -> str:
    control = station.control
    for i in range(1, recording.pumps + 1):
        dry_s = _longest_dry_s(recording, i)
        if dry_s > LONGEST_DRY_S:
            return f"pump {i} turns for {dry_s} s without moving water, {LONGEST_DRY_S} s are allowed"
        starts = np.flatnonzero(np.diff(recording.column(f"pump{i}_running")) > 0.0)
        most = int(np.max(np.searchsorted(starts, starts + HOUR_S) - np.arange(starts.size), initial=0))
        if 0 < control.max_starts_per_hour < most:
            return f"pump {i} starts {most} times in an hour, {control.max_starts_per_hour} are allowed"
    return ""


def _longest_dry_s(recording: Recording, pump: int) -> int:
    """Longest time for which a pump turns and moves no water. [s]."""
    flow_m3h = recording.truth[f"truth_pump{pump}_flow_m3h"]
    is_dry = (recording.column(f"pump{pump}_frequency_hz") > 0.0) & (flow_m3h <= DRY_SHARE * flow_m3h.max())
    edges = np.flatnonzero(np.diff(np.r_[False, is_dry, False]))
    return int(np.max(edges[1::2] - edges[::2], initial=0))
