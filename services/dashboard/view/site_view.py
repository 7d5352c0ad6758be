"""What the page knows of all stations: takes payloads from the bus, gives frames for the browsers."""

import json
import logging
import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from wetwell.protocols.bus.interface import Presence
from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.decoding import M, decoded
from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.protocols.messages.model import Model
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.dashboard.view.sample_row import spaced
from wetwell.services.dashboard.view.station_view import ROWS_A_FRAME, StationView

log = logging.getLogger(__name__)

ROWS = ((100, 1200), (1000, 200))
FEWEST_ROWS = 60
MOST_STATIONS = 10_000
"""Further names on the bus are passed over: somebody makes them up."""
"""Samples of each station that are kept for charts: with up to so many stations, and beyond."""


class SiteView:
    """State of all stations. A payload that is none of the site's messages is counted and left out.

    Parameters
    ----------
    stale_s : float
        Without a sample for so long, a station has no data. [s]
    """

    def __init__(self, stale_s: float) -> None:
        self.stations: dict[str, StationView] = {}
        self.services: dict[str, dict[str, Any]] = {}
        self.counts: Counter[str] = Counter()
        self.frame_id = 0
        self._order: list[StationView] = []
        self._stale_s = stale_s
        self._now_s = 0.0
        self._with_news: dict[str, StationView] = {}
        self._with_live: dict[str, StationView] = {}
        self._changed: dict[str, StationView] = {}

    def handle_sample(self, payload: bytes, *, is_kept: bool = False) -> None:
        """Take a sample; one that was kept for late joiners may be of any age, and is old until another comes."""
        sample = self._decoded(Sample, payload)
        if sample is not None:
            self._handle_samples(sample.station, [sample], is_kept=is_kept)

    def handle_samples(self, payloads: Sequence[bytes]) -> None:
        """Take samples of one station, oldest first; of many those that are drawn, evenly spaced, with the last."""
        before = -1
        for place in spaced(len(payloads), ROWS_A_FRAME):
            sample = self._decoded(Sample, payloads[place])
            if sample is not None:
                self._handle_samples(sample.station, [sample], place - before - 1)
                before = place

    def handle_sample_block(self, payload: bytes, *, is_kept: bool = False) -> None:
        """Take many samples of a station; the block that came last is left out."""
        block = self._decoded(SampleBlock, payload)
        if block is None:
            return
        samples = block.samples()
        if not self._station(block.station).is_last(samples[-1]):
            self._handle_samples(block.station, samples, is_kept=is_kept)

    def _handle_samples(
        self, name: str, samples: list[Sample], passed_over: int = 0, *, is_kept: bool = False
    ) -> None:
        station = self._station(name)
        quality = None if station.sample is None else station.sample.quality
        seen_s = -math.inf if is_kept else self._now_s
        new = [sample for sample in samples if station.handle_sample(sample, seen_s, passed_over)]
        if new:
            self._with_news[name] = self._with_live[name] = station
            if new[-1].quality != quality:
                self._changed[name] = station

    def handle_verdict(self, payload: bytes) -> None:
        """Take a verdict."""
        verdict = self._decoded(Verdict, payload)
        if verdict is not None:
            self._change(verdict.station).handle_verdict(verdict)

    def handle_model(self, payload: bytes) -> None:
        """Take the curves of a station."""
        model = self._decoded(Model, payload)
        if model is not None:
            self._change(model.station).handle_model(model)

    def handle_alarm(self, payload: bytes) -> None:
        """Take the last state of an alarm."""
        alarm = self._decoded(Alarm, payload)
        if alarm is not None:
            self._change(alarm.station).handle_alarm(alarm)

    def handle_gap(self, payload: bytes) -> None:
        """Take the gap between a station and its simulator."""
        gap = self._decoded(GapWatch, payload)
        if gap is not None:
            self._change(gap.station).handle_gap(gap)

    def handle_status(self, payload: bytes) -> None:
        """Take the health figures of a service."""
        status = self._decoded(Status, payload)
        if status is None:
            return
        service = self._service(status.station, status.service)
        service["status"] = json.loads(status.encode())
        service["seen_s"] = self._now_s
        if status.station != SITE:
            self._news(status.station).handle_status(status)

    def handle_presence(self, presence: Presence) -> None:
        """Take that a service has come or gone."""
        _, station, _, service = presence.key.split("/")
        if not self._is_named(station):
            return
        self._service(station, service)["is_alive"] = presence.is_alive
        if station != SITE:
            self._news(station).handle_presence(service, is_alive=presence.is_alive)
            return
        for each in self._order:
            each.handle_site(self._site_services)
            self._with_news[each.name] = each

    @property
    def _site_services(self) -> list[str]:
        """Services of the whole site that live."""
        return [
            each["service"] for each in self.services.values() if each["station"] == SITE and each.get("is_alive")
        ]

    def advance(self, now_s: float) -> dict[str, str]:
        """Next frame of each station that has news, as JSON. [s]."""
        self._now_s = now_s
        for station in self._order:
            station.now_s = now_s
            if station.settle(now_s, self._stale_s):
                self._with_news[station.name] = self._changed[station.name] = station
        self.frame_id += 1
        with_news, self._with_news = self._with_news, {}
        frames = {name: station.frame(self.frame_id) for name, station in with_news.items()}
        return {name: f'{{"id":{self.frame_id},{frame}}}' for name, frame in frames.items() if frame is not None}

    def site_frame(self) -> str | None:
        """JSON of what has changed in the overview since the last one; None if nothing has."""
        live, self._with_live = self._with_live, {}
        changed, self._changed = self._changed, {}
        if not live and not changed:
            return None
        return self._overview([station.live() for station in live.values()], changed)

    def site_state(self) -> str:
        """JSON of the whole overview, in the form of a frame."""
        return self._overview([station.live() for station in self._order], self.stations)

    def station_state(self, name: str) -> str | None:
        """JSON of all that is known of a station, in the form of a frame; None of one of which nothing was heard."""
        station = self.stations.get(name)
        if station is None or not station.is_known:
            return None
        return f'{{"id":{self.frame_id},{station.state()}}}'

    def empty_state(self, name: str) -> str:
        """State of a station that only the historian knows."""
        station = StationView(name, -1, 1)
        station.handle_site(self._site_services)
        return f'{{"id":{self.frame_id},{station.state()}}}'

    def health(self, now_s: float) -> list[dict[str, Any]]:
        """Services with their last figures and how long ago they came. [s]."""
        return [
            {key: value for key, value in service.items() if key != "seen_s"}
            | {"age_s": round(now_s - service["seen_s"], 1) if "seen_s" in service else None}
            for _, service in sorted(self.services.items())
        ]

    def alarms(self) -> str:
        """JSON array of all alarms that are not back to normal."""
        return f"[{','.join(alarm.encode().decode() for station in self._order for alarm in station.alarms)}]"

    def _overview(self, live: list[str], changed: dict[str, StationView]) -> str:
        summaries = {station.index: station.summary() for station in changed.values()}
        return f'{{"id":{self.frame_id},"live":[{",".join(live)}],"stations":{json.dumps(summaries)}}}'

    def _decoded(self, kind: type[M], payload: bytes) -> M | None:
        message = decoded(kind, payload, self.counts, log)
        if message is None or self._is_named(getattr(message, "station", SITE)):
            return message
        self.counts["foreign"] += 1
        return None

    def _is_named(self, station: str) -> bool:
        return station == SITE or station in self.stations or len(self.stations) < MOST_STATIONS

    def _news(self, name: str) -> StationView:
        station = self._station(name)
        self._with_news[name] = station
        return station

    def _change(self, name: str) -> StationView:
        station = self._news(name)
        self._changed[name] = station
        return station

    def _station(self, name: str) -> StationView:
        station = self.stations.get(name)
        if station is None:
            rows = next((rows for stations, rows in ROWS if len(self._order) < stations), FEWEST_ROWS)
            station = self.stations[name] = StationView(name, len(self._order), rows)
            station.handle_site(self._site_services)
            self._order.append(station)
            self._changed[name] = station
            if rows != self._order[0].kept_rows:
                for other in self._order:
                    other.kept_rows = rows
        return station

    def _service(self, station: str, service: str) -> dict[str, Any]:
        return self.services.setdefault(f"{station}/{service}", {"station": station, "service": service})
