"""What stands at fault: pump, main, meters, each with severity, trend and stage."""

import math
from dataclasses import dataclass, field

from wetwell.detector.curves.datasheet import Curve, Datasheet
from wetwell.detector.inference.asset_belief import AssetBelief
from wetwell.detector.verdict.maintenance import advice
from wetwell.detector.verdict.severity import speed_loss
from wetwell.detector.verdict.stage import STAGES, Quantity, severity_of, stage_of, trend_of
from wetwell.protocols.messages.verdict import AssetFault, Severity, Stage
from wetwell.protocols.station.costs import Costs
from wetwell.protocols.station.limits import Limits

STATIC_LOG_ODDS = math.log(20.0)
"""From which runs at several flows say that the static head has risen, and not friction."""

Meter = tuple[int, float, float]
"""Since when a meter is wrong [ns]; relative error and standard deviation of that, NaN where it tells nothing."""


def pump_quantities(curve: Curve, flow_m3h: float, limits: Limits) -> list[Quantity]:
    """In which the head that a pump has lost is told, at this Q/N: as a loss of speed, and of head."""
    c0, c1, c2 = curve
    head_m = max(c0 + c1 * flow_m3h + c2 * flow_m3h**2, 1e-9)
    share = limits.speed_loss_percent / 100.0
    return [
        Quantity(
            "speed_loss_percent",
            limits.speed_loss_percent,
            c0 * (1.0 - (1.0 - share) ** 2) + c1 * share * flow_m3h,
            lambda lost_m: 100.0 * speed_loss(-lost_m, curve, flow_m3h),
        ),
        Quantity(
            "wear_head_percent",
            limits.wear_head_percent,
            limits.wear_head_percent / 100.0 * head_m,
            lambda lost_m: 100.0 * lost_m / head_m,
        ),
    ]


def main_quantity(asset: AssetBelief, limits: Limits) -> Quantity:
    """In which a rise of friction is told: as one of k, unless runs at several flows say that the lift has risen."""
    if asset.log_static > STATIC_LOG_ODDS:
        return Quantity(
            "static_head_rise_m",
            limits.static_head_rise_m,
            limits.static_head_rise_m / asset.friction_m,
            lambda rise: rise * asset.friction_m,
        )
    limit = limits.friction_rise_percent
    return Quantity("friction_rise_percent", limit, limit / 100.0, lambda rise: 100.0 * rise)


@dataclass(frozen=True, slots=True)
class StageRules:
    """By what faults are staged: the limits of the station and, where it gives them, its costs."""

    limits: Limits = field(default_factory=Limits)
    costs: Costs | None = None


class AssetFaults:
    """Tells the faults that stand of one pump, its main and its meters, the worst first.

    Parameters
    ----------
    pump : int
        From 0.
    datasheet : Datasheet
    rules : StageRules
    """

    def __init__(self, pump: int, datasheet: Datasheet, rules: StageRules) -> None:
        main = datasheet.main_of(pump).name if len(datasheet.mains) > 1 else None
        self.pump_name, self.main_name = f"pump:{pump + 1}", "main" if main is None else f"main:{main}"
        self._curve = datasheet.curves[pump]
        self._limits, self._costs = rules.limits, rules.costs

    def told(self, pump: AssetBelief, main: AssetBelief, meters: dict[str, Meter]) -> tuple[AssetFault, ...]:
        """Faults that stand; their stages are remembered in the beliefs."""
        found: list[tuple[float, AssetFault]] = []
        if pump.since_ns is not None:
            quantities = pump_quantities(self._curve, pump.flow_m3h, self._limits)
            nearest = min(quantities, key=lambda quantity: quantity.size_at_limit)
            crew = None if self._costs is None else self._costs.pull_pump
            found.append(self._fault(self.pump_name, pump, nearest, crew, advice("pump_fault")))
        if main.since_ns is not None:
            crew = None if self._costs is None else self._costs.flush_main
            quantity = main_quantity(main, self._limits)
            found.append(self._fault(self.main_name, main, quantity, crew, advice("system_fault")))
        found += [self._meter_fault(name, meter) for name, meter in sorted(meters.items())]
        return tuple(fault for _, fault in sorted(found, key=_rank, reverse=True))

    def severity(self, name: str, pump: AssetBelief, main: AssetBelief) -> Severity | None:
        """Severity of the pump or the main as it is now, whether it stands at fault or not; None of others."""
        if name == self.pump_name and pump.track.time_ns is not None:
            quantities = pump_quantities(self._curve, pump.flow_m3h, self._limits)
            return severity_of(*pump.track.size, min(quantities, key=lambda quantity: quantity.size_at_limit))
        if name == self.main_name and main.track.time_ns is not None:
            return severity_of(*main.track.size, main_quantity(main, self._limits))
        return None

    def _fault(
        self, name: str, asset: AssetBelief, quantity: Quantity, crew: float | None, what: str
    ) -> tuple[float, AssetFault]:
        size, variance = asset.track.size
        share = abs(size) / quantity.size_at_limit
        stage = stage_of(size, variance, quantity.size_at_limit, asset.stage)
        if crew is not None and stage == "plan" and (asset.stage == "act" or self._waiting(asset, share) > crew):
            stage = "act"
        asset.stage = stage
        fault = AssetFault(
            asset=name,
            stage=stage,
            since=asset.since_ns or 0,
            severity=severity_of(size, variance, quantity),
            trend=trend_of(asset.track, asset.scale, quantity),
            advice=what,
        )
        return share, fault

    def _waiting(self, asset: AssetBelief, share: float) -> float:
        """What a fault is expected to cost until the next visit: it fails the more, the nearer its limit."""
        costs = self._costs or Costs()
        energy = sum(asset.wasted_kwh.values()) * costs.horizon_days * costs.energy_per_kwh
        return energy + costs.failure_share * min(share, 1.0) * costs.call_out

    def _meter_fault(self, name: str, meter: Meter) -> tuple[float, AssetFault]:
        """A meter that tells nothing is to be mended at the next visit; one that is off goes by its limit."""
        since_ns, error, deviation = meter
        limit = self._limits.meter_error_percent
        stage: Stage = "plan"
        severity: Severity | None = None
        if math.isfinite(error):
            quantity = Quantity("meter_error_percent", limit, limit / 100.0, lambda value: 100.0 * value)
            stage, severity = (
                stage_of(error, deviation**2, limit / 100.0, None),
                severity_of(error, deviation**2, quantity),
            )
        share = 0.5 if severity is None else abs(severity.value) / limit
        fault = AssetFault(
            asset=f"sensor:{name}", stage=stage, since=since_ns, severity=severity, advice=advice("sensor_fault")
        )
        return share, fault


def _rank(item: tuple[float, AssetFault]) -> tuple[int, float]:
    share, fault = item
    return STAGES.index(fault.stage), share
