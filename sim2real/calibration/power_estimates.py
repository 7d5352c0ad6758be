"""What a recording tells of the power that pumps take."""

from collections.abc import Sequence

import numpy as np

from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.calibration.estimates import Estimate
from wetwell.sim2real.calibration.fit.main_fit import numbered
from wetwell.sim2real.calibration.fit.power_fit import PowerLines, fit_power
from wetwell.sim2real.calibration.fit.prior import power_prior
from wetwell.sim2real.calibration.main_estimates import MIN_RUNS
from wetwell.sim2real.calibration.steady import SteadyDuties
from wetwell.simulator.parameters import plant_parameters

KEYS = ("power_scale", "power_slope")


def power_estimates(duties: SteadyDuties, station: Station, main: int) -> list[Estimate]:
    """Estimates of size and slope of the lines of shaft power of a main's pumps.

    Parameters
    ----------
    duties : SteadyDuties
        Of the pumps of this main.
    station : Station
    main : int
        From 0.
    """
    members = station.pumps_of_main(main)
    lines = power_lines(station, members)
    prior = power_prior(np.array([lines.rated_flow_m3h, lines.rated_shaft_kw, lines.shutoff_share]).T)
    parameters = [
        Estimate(
            name=f"pump[{i + 1}].{key}",
            unit="",
            value=float(prior.mean[k]),
            place=("pump", i, key),
            prior=(float(prior.mean[k]), float(prior.sd[k])),
        )
        for k, (key, i) in enumerate((key, i) for key in KEYS for i in members)
    ]
    if station.electrical.power_model != "load":
        reason = f"electrical.power_model = '{station.electrical.power_model}' does not know the load"
        return [parameter.kept(reason) for parameter in parameters]
    point, pump = np.nonzero(np.isfinite(duties.power_kw + duties.flow_m3h))
    if point.size == 0:
        return [parameter.kept("no steady running with power and flow") for parameter in parameters]
    run = numbered(duties.run[point, pump], pump)
    if run.max() + 1 < MIN_RUNS:
        reason = f"{run.max() + 1} runs with steady power and flow, at least {MIN_RUNS} are needed"
        return [parameter.kept(reason) for parameter in parameters]
    fit = fit_power(
        lines,
        prior,
        pump=pump,
        run=run,
        speed_ratio=duties.speed_ratio[point, pump],
        flow_m3h=duties.flow_m3h[point, pump],
        power_kw=duties.power_kw[point, pump],
    )
    is_seen = np.isin(np.arange(len(members)), pump)
    estimates = []
    for k, parameter in enumerate(parameters):
        told = parameter.told(float(fit.value[k]), float(fit.sd[k]))
        if not fit.is_told[k]:
            told = parameter.kept(f"±{fit.sd[k]:.2g} after the recording, ±{fit.prior.sd[k]:.2g} before")
        elif not is_seen[k % len(members)]:
            told = parameter.told(
                float(fit.value[k]),
                float(fit.sd[k]),
                reason="never seen in steady running: as the pumps with its datasheet",
            )
        estimates.append(told)
    return estimates


def power_lines(station: Station, members: Sequence[int]) -> PowerLines:
    """Lines of power of pumps, counted from 0, as the station file has them."""
    pumps = [plant_parameters(station).pumps[i] for i in members]
    return PowerLines(
        rated_flow_m3h=np.array([pump.rated_flow_m3h for pump in pumps]),
        rated_shaft_kw=np.array([pump.rated_shaft_kw for pump in pumps]),
        shutoff_share=np.array([pump.shutoff_power_share for pump in pumps]),
        efficiency=station.electrical.motor_efficiency * station.electrical.drive_efficiency,
    )
