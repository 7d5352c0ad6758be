"""Figures of stations for Prometheus: what a Grafana dashboard of stations draws."""

from collections.abc import Iterable

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from wetwell.detector.verdict.stage import STAGES
from wetwell.protocols.quantities import PUMP_ANALOGUES
from wetwell.services.dashboard.view.cause import Cause, standing_causes, states_of
from wetwell.services.dashboard.view.site_view import SiteView
from wetwell.services.dashboard.view.station_view import RANKS, StationView

_OF_PUMP = ("station", "pump")
_OF_ASSET = ("station", "pump", "asset", "quantity")


class StationMetrics(Collector):
    """Level, flow, head, frequency, power, energy, state, severity and trend, by station and pump.

    Of a station without samples, and of one whose samples are bad, the measured values are left out: a gap, and not
    the last value for ever.

    Parameters
    ----------
    view : SiteView
    """

    def __init__(self, view: SiteView) -> None:
        self._view = view

    def collect(self) -> Iterable[Metric]:
        """Figures as Prometheus takes them."""
        stations = list(self._view.stations.values())
        yield from self._of_stations(stations)
        yield from _measured(stations)
        yield from _judged(stations)

    def _of_stations(self, stations: list[StationView]) -> Iterable[Metric]:
        seen = GaugeMetricFamily("wetwell_station_is_seen", "1 while good samples come.", labels=("station",))
        level = GaugeMetricFamily("wetwell_station_level_m", "Level in the wet well. [m]", labels=("station",))
        alarms = GaugeMetricFamily("wetwell_station_alarms", "Alarms that are not normal.", labels=("station",))
        for station in stations:
            seen.add_metric((station.name,), float(station.is_good))
            alarms.add_metric((station.name,), float(len(station.alarms)))
            if station.is_good and station.sample is not None and station.sample.level_m is not None:
                level.add_metric((station.name,), station.sample.level_m)
        yield from (seen, level, alarms)


def _measured(stations: list[StationView]) -> Iterable[Metric]:
    for name in PUMP_ANALOGUES:
        family = GaugeMetricFamily(f"wetwell_pump_{name}", f"{name.rpartition('_')[0]} of a pump.", labels=_OF_PUMP)
        for station in stations:
            readings = station.sample.pumps if station.is_good and station.sample is not None else ()
            for pump, reading in enumerate(readings, start=1):
                value = getattr(reading, name)
                if value is not None:
                    family.add_metric((station.name, str(pump)), value)
        yield family
    energy = CounterMetricFamily(
        "wetwell_pump_energy_kwh", "Energy that a pump has taken since this process began. [kWh]", labels=_OF_PUMP
    )
    for station in stations:
        for pump, energy_kwh in list(station.energy_kwh.items()):
            energy.add_metric((station.name, str(pump)), energy_kwh)
    yield energy


def _judged(stations: list[StationView]) -> Iterable[Metric]:
    states = GaugeMetricFamily("wetwell_pump_state", "1 for the state of the verdict.", labels=(*_OF_PUMP, "state"))
    stage = GaugeMetricFamily("wetwell_pump_stage", "0 none, 1 watch, 2 plan, 3 act.", labels=_OF_PUMP)
    severity = GaugeMetricFamily("wetwell_severity", "How far a fault has gone, in its quantity.", labels=_OF_ASSET)
    limit = GaugeMetricFamily("wetwell_severity_limit", "Action limit of the quantity.", labels=_OF_ASSET)
    trend = GaugeMetricFamily("wetwell_severity_trend_per_day", "Growth of the severity in a day.", labels=_OF_ASSET)
    for station in stations:
        verdicts = list(station.last_verdicts.values())  # the loop adds to it meanwhile
        standing, now = standing_causes(verdicts), states_of(verdicts)
        for pump in now:
            name = (station.name, str(pump))
            for state in RANKS:
                if state != "no_data":
                    states.add_metric((*name, state), float(state == now[pump]))
            causes = standing.get(pump, [])
            stage.add_metric(name, max(map(_stage_number, causes), default=0.0))
            for cause in causes:
                _add_severity(name, cause, severity, limit, trend)
    yield from (states, stage, severity, limit, trend)


def _stage_number(cause: Cause) -> float:
    return float(STAGES.index(cause["stage"]) + 1) if cause["stage"] in STAGES else 0.0


def _add_severity(
    name: tuple[str, str],
    cause: Cause,
    severity: GaugeMetricFamily,
    limit: GaugeMetricFamily,
    trend: GaugeMetricFamily,
) -> None:
    told = cause["severity"]
    if told is None:
        return
    labels = (*name, cause["asset"], told["quantity"])
    severity.add_metric(labels, told["value"])
    limit.add_metric(labels, told["limit"])
    if cause["trend"] is not None:
        trend.add_metric(labels, cause["trend"]["per_day"])
