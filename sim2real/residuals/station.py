"""How far a prediction is from a recording, all signals together, in units of noise."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.regimes import Regimes
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Doubt, Prediction
from wetwell.sim2real.residuals.bins import Bins, joined
from wetwell.sim2real.residuals.events import event_residuals
from wetwell.sim2real.residuals.level import level_residuals
from wetwell.sim2real.residuals.signals import pump_residuals
from wetwell.sim2real.residuals.telemetry import telemetry_residuals


class _Part(Protocol):
    """Residuals of one kind."""

    @property
    def bins(self) -> Bins: ...

    def of(self, prediction: Prediction) -> Floats: ...


class StationResiduals:
    """Residuals of a recording; which they are and what they weigh is the same for every prediction.

    Parameters
    ----------
    traces : Traces
    station : Station
    regimes : Regimes
    plain : Prediction
        Of the station as it is.
    doubt_where : callable
        What a right model may be off, by whether the level is held.

    Attributes
    ----------
    half_step_m : float
        By which all levels at which pumps are switched may be off alike: nobody says whether they are cut off. [m]
    """

    def __init__(
        self,
        traces: Traces,
        station: Station,
        regimes: Regimes,
        plain: Prediction,
        doubt_where: Callable[[bool], Doubt],
    ) -> None:
        self.telemetry = telemetry_residuals(traces, station, regimes)
        self.half_step_m = 0.0
        patterns = {pattern.quantity: pattern for pattern in self.telemetry.patterns}
        doubt = doubt_where("level_m" in patterns and patterns["level_m"].deadband > 0.0)
        self._parts: list[_Part] = [*pump_residuals(traces, station, regimes, plain, doubt, patterns), self.telemetry]
        if np.isfinite(traces.level_m).any():
            level = level_residuals(traces, station, regimes, plain, doubt, patterns)
            self._parts += [level] if level.bins.size else []
            events = event_residuals(traces, station, regimes, doubt.observer, patterns.get("level_m"))
            self._parts.append(events)
            self.half_step_m = events.half_step_m
        self.bins = joined([part.bins for part in self._parts])

    def of(self, prediction: Prediction) -> Floats:
        """(bins,) residuals in units of noise."""
        return np.concatenate([part.of(prediction) for part in self._parts])
