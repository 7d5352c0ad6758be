"""What a recording tells of a main and the curves of its pumps."""

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.calibration.estimates import Estimate
from wetwell.sim2real.calibration.fit.main_fit import fit_main, witness_of
from wetwell.sim2real.calibration.fit.main_model import FRICTION, SHIFT, MainModel
from wetwell.sim2real.calibration.fit.prior import main_prior
from wetwell.sim2real.calibration.fit.regularised_fit import Posterior
from wetwell.sim2real.calibration.steady import SteadyDuties
from wetwell.simulator.parameters import plant_parameters

MIN_RUNS = 4
"""Runs from which on what they have in common can be told from what one of them has."""


def main_estimates(duties: SteadyDuties, station: Station, main: int) -> list[Estimate]:
    """Estimates of the curves of a main's pumps, of its lift and friction, and of the heads at its usual duties.

    Parameters
    ----------
    duties : SteadyDuties
        Of the pumps of this main.
    station : Station
    main : int
        From 0.
    """
    members = station.pumps_of_main(main)
    table, parameters = station.mains[main], plant_parameters(station)
    lift_m = table.lift_at_zero_m - table.level_slope * (duties.level_m if table.level_slope else 0.0)
    lift_m = np.maximum(np.broadcast_to(lift_m, len(duties)), 0.0)
    known = np.isfinite(lift_m)
    is_common = table.layout == "common"
    curves, rated_m3h = parameters.curves[members], parameters.rated_flow_m3h[members]
    model = MainModel(
        curves=curves,
        is_common=is_common,
        speed_ratio=np.ascontiguousarray(duties.speed_ratio[known]),
        lift_m=np.ascontiguousarray(lift_m[known]),
    )
    runs = duties.run[known]
    candidates = (
        witness_of("flow", duties.flow_m3h[known], runs),
        witness_of("head", duties.head_m[known], runs),
    )
    witnesses = [witness for witness in candidates if witness is not None]
    prior = main_prior(
        curves,
        friction_h2_m5=table.friction_h2_m5,
        rated_flow_m3h=float(rated_m3h.sum() if is_common else rated_m3h.max()),
    )
    seen = max((int(witness.run.max()) + 1 for witness in witnesses), default=0)
    if seen < MIN_RUNS:
        reason = f"{seen} runs with steady speed and flow or head, at least {MIN_RUNS} are needed"
        kept = [one.kept(reason) for one in _parameters(station, main, members, prior.mean, prior.sd)]
        return _by_pump(kept, len(members))
    fit = fit_main(model, witnesses, prior)
    own = [sum(int(np.unique(w.run[w.pump == k]).size) for w in witnesses[:1]) for k in range(len(members))]
    estimates = [
        _judged(one, fit, k, own) for k, one in enumerate(_parameters(station, main, members, prior.mean, prior.sd))
    ]
    return _by_pump(estimates, len(members)) + _duty_heads(model, fit, station, main, members, duties.flow_m3h[known])


def _parameters(station: Station, main: int, members: list[int], mean: Floats, sd: Floats) -> list[Estimate]:
    """Parameters in the order of the fit, as the file has them."""
    table = station.mains[main]
    place: tuple[str | int, ...] = ("rising_main",) if station.main is None else ("main", main)
    name = main_name(station, main)
    lift = "static_head_m" if table.delivery_level_m is None else "delivery_level_m"
    scales = [
        Estimate(name=f"pump[{i + 1}].{key}", unit="", value=1.0, place=("pump", i, key), prior=(1.0, float(sd[k])))
        for key, first in (("head_scale", 0), ("flow_scale", len(members)))
        for k, i in enumerate(members, start=first)
    ]
    return [
        *scales,
        Estimate(
            name=f"{name}.{lift}",
            unit="m",
            value=table.lift_at_zero_m,
            place=(*place, lift),
            prior=(table.lift_at_zero_m, float(sd[SHIFT])),
        ),
        Estimate(
            name=f"{name}.friction_h2_m5",
            unit="h²/m⁵",
            value=table.friction_h2_m5,
            place=(*place, "friction_h2_m5"),
            prior=(float(mean[FRICTION]), float(sd[FRICTION])),
        ),
    ]


def _by_pump(estimates: list[Estimate], pumps: int) -> list[Estimate]:
    """Estimates in the order of the fit, put into that of the pumps."""
    return [estimates[k] for pump in range(pumps) for k in (pump, pumps + pump)] + estimates[2 * pumps :]


def main_name(station: Station, main: int) -> str:
    """Name of a main's table in the station file."""
    return "rising_main" if station.main is None else f"main[{main + 1}]"


def _judged(parameter: Estimate, fit: Posterior, k: int, own: list[int]) -> Estimate:
    """A parameter of the fit as estimated, or as kept with the reason."""
    sd, before = float(fit.sd[k]), float(fit.prior.sd[k])
    pumps = len(own)
    is_scale = k < 2 * pumps
    if not fit.is_told[k]:
        if is_scale and own[k % pumps] == 0:
            return parameter.kept("never seen in steady running, and its sisters say too little")
        what = (
            "the duties seen do not tell head from flow"
            if is_scale
            else "lift, friction and curves cannot be told apart"
        )
        return parameter.kept(f"{what}: ±{sd:.2g} after the recording, ±{before:.2g} before")
    lowest = 0.0 if parameter.name.endswith("friction_h2_m5") else -np.inf
    value = parameter.value + float(fit.value[k]) if parameter.unit == "m" else float(fit.value[k])
    reason = (
        "never seen in steady running: as the pumps with its datasheet" if is_scale and own[k % pumps] == 0 else ""
    )
    return parameter.told(value, sd, lowest=lowest, reason=reason)


def _duty_heads(
    model: MainModel, fit: Posterior, station: Station, main: int, members: list[int], flow_m3h: Floats
) -> list[Estimate]:
    """Heads at the usual flow at nominal speed: what one duty tells well, though no parameter of a curve alone."""
    estimates = []
    curves = model.changed_curves(fit.value)
    free = [*range(2 * len(members))]
    for k, i in enumerate(members):
        seen = flow_m3h[:, k] / np.where(model.speed_ratio[:, k] > 0.0, model.speed_ratio[:, k], 1.0)
        seen = seen[np.isfinite(seen)]
        if seen.size == 0:
            continue
        usual_m3h = float(f"{np.median(seen):.4g}")
        c0, c1, c2 = curves[k]
        head_m = float(c0 + (c1 + c2 * usual_m3h) * usual_m3h)
        slopes = np.zeros(len(free))
        slopes[k] = head_m / fit.value[k]
        slopes[len(members) + k] = -(c1 + 2.0 * c2 * usual_m3h) * usual_m3h / fit.value[len(members) + k]
        sd_m = float(np.sqrt(slopes @ fit.covariance[np.ix_(free, free)] @ slopes))
        parameter = Estimate(name=f"pump[{i + 1}].duty_head_m", unit="m", value=head_m)
        estimates.append(parameter.told(head_m, sd_m, reason=f"at {usual_m3h:.4g} m³/h and nominal speed"))
    return estimates + _main_duty(model, fit, station, main, flow_m3h)


def _main_duty(model: MainModel, fit: Posterior, station: Station, main: int, flow_m3h: Floats) -> list[Estimate]:
    """Head of the main at its usual flow and level."""
    loaded_m3h = np.nansum(flow_m3h, axis=1) if model.is_common else flow_m3h[np.isfinite(flow_m3h)]
    loaded_m3h = loaded_m3h[loaded_m3h > 0.0]
    if loaded_m3h.size == 0:
        return []
    usual_m3h, lift_m = float(f"{np.median(loaded_m3h):.4g}"), float(f"{np.median(model.lift_m):.4g}")
    head_m = lift_m + float(fit.value[SHIFT]) + float(fit.value[FRICTION]) * usual_m3h**2
    slopes = np.array([1.0, usual_m3h**2])
    places: Integers = np.array([SHIFT, FRICTION]) + fit.value.size
    sd_m = float(np.sqrt(slopes @ fit.covariance[np.ix_(places, places)] @ slopes))
    parameter = Estimate(name=f"{main_name(station, main)}.duty_head_m", unit="m", value=head_m)
    return [parameter.told(head_m, sd_m, reason=f"at {usual_m3h:.4g} m³/h and a lift of {lift_m:.4g} m")]
