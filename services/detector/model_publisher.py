"""Publishes the curves that the detector believes in, when they change."""

from wetwell.detector.detector import Detector
from wetwell.detector.verdict.station_model import StationModel
from wetwell.protocols.bus.interface import Outlet
from wetwell.protocols.bus.keys import model_key
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import Station
from wetwell.services.runtime.clock import now_ns


class ModelPublisher:
    """Publishes the model of a station: at the beginning, after each run that was judged, and after each order."""

    def __init__(self, bus: Outlet, station: Station, detector: Detector) -> None:
        self._model = StationModel(station)
        self._detector = detector
        self._publisher = bus.publisher(model_key(station.name))
        self._told: dict[int, Verdict] = {}
        self._publish(now_ns())

    def update(self, verdict: Verdict) -> None:
        """Publish what this verdict changes, if anything."""
        if "shift_m" in verdict.evidence:
            self._told[verdict.pump] = verdict
        elif verdict.state == "learning" or "order" in verdict.evidence:
            if self._told.pop(verdict.pump, None) is None:
                return
        else:
            return
        self._publish(verdict.time)

    def _publish(self, time_ns: int) -> None:
        model = self._model.message(self._detector.baselines, self._told, time_ns)
        self._publisher.put(model.encode())
