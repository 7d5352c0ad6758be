"""Calibration of a station file from a recording: what it can tell, with intervals, and what it cannot."""

import numpy as np

from wetwell.protocols.arrays import Flags
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.calibration.estimates import Estimate
from wetwell.sim2real.calibration.fitted_station import possible_estimates
from wetwell.sim2real.calibration.main_estimates import main_estimates
from wetwell.sim2real.calibration.power_estimates import power_estimates
from wetwell.sim2real.calibration.steady import running_of, steady_duties
from wetwell.sim2real.calibration.switches import area_estimate, level_estimates, ramp_estimate
from wetwell.sim2real.recording.checks import check_rising


def calibrate(recording: Recording, station: Station, *, seed: int = 0) -> tuple[Estimate, ...]:
    """Estimates of curves, mains, power, area, levels and ramp, with 95 % intervals.

    Curves, lift and friction of a main are one fit with the datasheets as prior, over steady duties at any rate;
    where no head is measured the flow at a speed and a level stands for it. Area, levels and ramp come from the
    moments in which pumps are started and stopped. What the recording cannot tell stays as it is in the file, with
    the reason.

    Parameters
    ----------
    recording : Recording
        Prepared: times rise.
    station : Station
        Starting point, and what is kept where the recording cannot tell. Its effects are not looked at.
    seed : int
        Of the bootstrap over events.

    Raises
    ------
    ValueError
        If times do not rise, or the numbers of pumps differ.
    """
    check_rising(recording)
    if recording.pumps > len(station.pump):
        raise ValueError(f"the recording has {recording.pumps} pumps, station '{station.name}' {len(station.pump)}")
    rng = np.random.default_rng(seed)
    running = running_of(recording, station)
    estimates: list[Estimate] = []
    power: list[Estimate] = []
    for main in range(len(station.mains)):
        pumps: Flags = np.array(station.main_of_pump) == main
        duties = steady_duties(recording, station, running, pumps)
        estimates += main_estimates(duties, station, main)
        power += power_estimates(duties, station, main)
    estimates += power
    estimates.append(area_estimate(recording, station, running, rng))
    estimates += level_estimates(recording, station, running, rng)
    estimates.append(ramp_estimate(recording, station, running, rng))
    return tuple(possible_estimates(station, estimates))
