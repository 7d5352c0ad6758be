"""The curves of a station as configured, as learnt and as the last verdict sees them, for those who draw them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wetwell.detector.baseline.model import Baseline
from wetwell.detector.baseline.model import Model as ResidualModel
from wetwell.detector.curves.datasheet import Datasheet, datasheet_of
from wetwell.detector.verdict.severity import SIGMAS_95
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.model import Curve, Model, PumpModel
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import Station

POINTS = 31
FLOW_SHARE = 0.98
"""Curves are drawn from no flow to this share of the flow at which the pump gives no head."""


class StationModel:
    """Model of a station; of each pump it is worked out anew only when its baseline or its verdict is another."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._datasheet = datasheet_of(station)
        self._known: dict[int, tuple[Baseline | None, Verdict | None, PumpModel]] = {}

    def message(self, baselines: Sequence[Baseline | None], told: Mapping[int, Verdict], time_ns: int) -> Model:
        """As a message.

        Parameters
        ----------
        baselines : sequence of Baseline or None
            What was learnt of each pump.
        told : mapping
            Last verdict with a shift on each pump, by its number from 1.
        time_ns : int
            Stamp of the message.
        """
        return Model(
            time=time_ns,
            station=self._station.name,
            nominal_frequency_hz=self._datasheet.frequencies_hz[0],
            start_levels_m=self._station.control.start_levels_m,
            stop_levels_m=self._station.control.stop_levels_m,
            floor_area_m2=self._datasheet.area_m2,
            floor_level_m=self._datasheet.floor_level_m,
            is_common_header=len(self._datasheet.mains) == 1 and self._datasheet.mains[0].is_common_header,
            pumps=tuple(self._pump(index, baseline, told.get(index + 1)) for index, baseline in enumerate(baselines)),
        )

    def _pump(self, index: int, baseline: Baseline | None, verdict: Verdict | None) -> PumpModel:
        known = self._known.get(index)
        if known is not None and known[0] is baseline and known[1] is verdict:
            return known[2]
        curves = pump_model(index, self._datasheet, baseline, {} if verdict is None else verdict.evidence)
        main = self._station.main_of_pump[index]
        on_main = [number for number, other in enumerate(self._station.main_of_pump, start=1) if other == main]
        names = {
            "name": self._station.pump[index].name,
            "main": self._station.mains[main].name,
            "header": tuple(on_main if self._datasheet.mains[main].is_common_header else ()),
        }
        model = curves.model_copy(update=names)
        self._known[index] = baseline, verdict, model
        return model


def pump_model(index: int, datasheet: Datasheet, baseline: Baseline | None, evidence: Mapping[str, Any]) -> PumpModel:
    r"""Curves of one pump (from 0) and of its main.

    Learnt: the configured curve plus the learnt residual at the mean level, with the 95 % band of the mean of a
    healthy segment. Now: the learnt curves moved by the shift of the last verdict; the pump curve by the loss of
    speed λ that the shift stands for,

    $$H = c_0 (1-\lambda)^2 + c_1 (1-\lambda) Q + c_2 Q^2 + r_p(Q)$$

    and the system curve upwards, since at one operating point more friction and more lift look the same.

    Examples
    --------
    >>> from wetwell.protocols.station.station_file import Pump, Station, Sump
    >>> station = Station(name="s", sump=Sump(area_m2=8.0), pump=(Pump(curve=(36.0, 0.0, -2.5e-4)),))
    >>> model = pump_model(0, datasheet_of(station), None, {})
    >>> model.configured_pump.head_m[0], model.learnt_pump, model.now_pump
    (36.0, None, None)
    """
    c0, c1, c2 = datasheet.curves[index]
    flow_m3h = np.linspace(0.0, FLOW_SHARE * datasheet.runout_flow_m3h(index), POINTS)
    pump_m = c0 + c1 * flow_m3h + c2 * flow_m3h**2
    main = datasheet.main_of(index)
    level_m = datasheet.middle_level_m if baseline is None or not np.isfinite(baseline.level_m) else baseline.level_m
    system_m = main.static_head_at_m(level_m) + main.friction_h2_m5 * flow_m3h**2
    configured = {"configured_pump": _curve(flow_m3h, pump_m), "configured_system": _curve(flow_m3h, system_m)}
    if baseline is None:
        return PumpModel(pump=index + 1, **configured)
    noise_m2 = np.diag(baseline.segment_covariance + baseline.run_covariance)
    levels_m = np.full(POINTS, baseline.level_m if np.isfinite(baseline.level_m) else 0.0)
    r_p, pump_band_m = _learnt(baseline.pump, noise_m2[0], np.column_stack((flow_m3h, flow_m3h**2, levels_m)))
    r_s, system_band_m = _learnt(baseline.system, noise_m2[1], np.column_stack((flow_m3h**2, levels_m)))
    learnt = {
        "learnt_pump": _curve(flow_m3h, pump_m + r_p, pump_band_m),
        "learnt_system": _curve(flow_m3h, system_m + r_s, system_band_m),
    }
    if "shift_m" not in evidence:
        return PumpModel(pump=index + 1, **configured, **learnt)
    loss = evidence.get("severity", {}).get("speed_loss_percent")
    speed = 1.0 - (loss["value"] if loss else 0.0) / 100.0
    moved_m = c0 * speed**2 + c1 * speed * flow_m3h + c2 * flow_m3h**2
    if not loss:
        moved_m += evidence["shift_m"]["pump"]
    now = {
        "now_pump": _curve(flow_m3h, moved_m + r_p, _band_m("pump", evidence)),
        "now_system": _curve(flow_m3h, system_m + r_s + evidence["shift_m"]["system"], _band_m("system", evidence)),
    }
    return PumpModel(pump=index + 1, **configured, **learnt, **now)


def _learnt(model: ResidualModel, noise_m2: float, points: Floats) -> tuple[Floats, Floats]:
    """Learnt residual at each operating point and half the width of its band. [m]."""
    residual_m, variance_m2 = model.along(points)
    return residual_m, SIGMAS_95 * np.sqrt(variance_m2 + noise_m2)


def _band_m(component: str, evidence: Mapping[str, Any]) -> Floats:
    """Half the width of the band of a shift: it is told in metres and in standard deviations. [m]."""
    sigmas = evidence.get("shift_sigmas", {}).get(component)
    return np.array(SIGMAS_95 * abs(evidence["shift_m"][component] / sigmas) if sigmas else np.nan)


def _curve(flow_m3h: Floats, head_m: Floats, band_m: Floats | None = None) -> Curve:
    flow, head = _rounded(flow_m3h, 1), _rounded(head_m, 2)
    if band_m is None or not np.all(np.isfinite(band_m)):
        return Curve(flow_m3h=flow, head_m=head)
    return Curve(flow_m3h=flow, head_m=head, low_m=_rounded(head_m - band_m, 2), high_m=_rounded(head_m + band_m, 2))


def _rounded(values: Floats, digits: int) -> tuple[float, ...]:
    return tuple(np.round(values, digits).tolist())
