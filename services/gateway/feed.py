"""What one PLC has told so far: samples from its polls, supervision of its heartbeat, health figures."""

import logging
from collections import Counter, deque
from collections.abc import Mapping

from wetwell.protocols.errors import LinkError
from wetwell.protocols.messages.sample import PumpReading, Quality, Sample
from wetwell.protocols.messages.status import ServiceState
from wetwell.protocols.modbus.client import NoAnswerError, RefusedError, WrongAnswerError
from wetwell.protocols.modbus.device_map import Plc
from wetwell.protocols.quantities import PUMP_ANALOGUES, pump_column
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S
from wetwell.services.gateway.poll import Poll

log = logging.getLogger(__name__)

KEPT = 600
"""Latest polls over which the quantiles of the health figures go."""
_COUNTED_AS = {NoAnswerError: "timeouts", WrongAnswerError: "wrong_answers", RefusedError: "refused_polls"}


class StationFeed:
    """Turns the polls of one PLC into samples; knows no clock: `now_s` is a time that only goes forward.

    Parameters
    ----------
    plc : Plc
        The PLC.

    Attributes
    ----------
    counts : Counter
        What has happened since the start, by name.
    """

    def __init__(self, plc: Plc) -> None:
        self._plc = plc
        self.counts: Counter[str] = Counter()
        self._latencies_s: deque[float] = deque(maxlen=KEPT)
        self._delays_s: deque[float] = deque(maxlen=KEPT)
        self._good_s: float | None = None
        self._away_since_s: float | None = None
        self._away_reason = ""
        self._beat: float | None = None
        self._beat_s: float | None = None
        self._stands = False
        self._refused: Mapping[str, str] = {}

    def connected(self) -> None:
        """Count a connection that was made."""
        self.counts["connections"] += 1

    def due(self, delay_s: float, skipped: int) -> None:
        """Count a poll that begins so late, and those before it that had to be left out."""
        self.counts["polls"] += 1
        self.counts["skipped_polls"] += skipped
        self._delays_s.append(delay_s)

    def fail(self, error: LinkError, now_s: float) -> None:
        """Take a poll, or a connection, that came to nothing: no sample is made."""
        kind = next((name for of, name in _COUNTED_AS.items() if isinstance(error, of)), "lost_connections")
        self.counts["failed_connections" if str(error).startswith("cannot connect") else kind] += 1
        self._away_reason = str(error)
        if self._away_since_s is None:
            self._away_since_s = now_s
            log.warning("station '%s': %s: %s", self._plc.station, self._plc.endpoint, error)

    def handle_poll(self, poll: Poll, stamp_ns: int, latency_s: float, now_s: float) -> Sample | None:
        """Sample of a poll that began at `stamp_ns` and took `latency_s`; None if it has no time."""
        self.counts["good_polls"] += 1
        self._latencies_s.append(latency_s)
        self._good_s = now_s
        if self._away_since_s is not None:
            log.info("station '%s': answers again after %.1f s", self._plc.station, now_s - self._away_since_s)
            self._away_since_s = None
        self._note_refusals(poll.refused)
        quality = self._watch_heartbeat(poll.values, now_s)
        if self._plc.device.clock == "plc":
            time_s = poll.values["time_s"]
            if not time_s or abs(time_s) > MAX_STAMP_NS / NS_PER_S - 1.0:  # whole numbers know no "no value" but 0
                self.counts["without_time"] += 1
                return None
            stamp_ns = round(time_s * NS_PER_S)
        self.counts["samples"] += 1
        return Sample(
            station=self._plc.station,
            seq=self.counts["samples"] - 1,
            time=stamp_ns,
            level_m=poll.values.get("level_m"),
            inflow_m3h=poll.values.get("inflow_m3h"),
            pumps=tuple(self._reading(poll.values, number) for number in range(1, self._plc.pumps + 1)),
            quality=quality,
        )

    def condition(self, now_s: float) -> tuple[ServiceState, str]:
        """State of the feed, and why, for people."""
        if self._away_since_s is not None:
            return "waiting", f"{self._plc.endpoint}: {self._away_reason}, for {now_s - self._away_since_s:.0f} s"
        if self._good_s is None:
            return "starting", ""
        reasons = [f"heartbeat stands for {self._beat_age_s(now_s):.0f} s"] if self._stands else []
        reasons += [f"{name}: {reason}" for name, reason in self._refused.items()]
        return "running", "; ".join(reasons)

    def figures(self, now_s: float) -> dict[str, float]:
        """Health figures; those that nothing is known of yet are left out."""
        figures = {name: float(count) for name, count in self.counts.items()}
        figures["reconnects"] = max(0.0, self.counts["connections"] - 1.0)
        for name, values in (("latency", self._latencies_s), ("delay", self._delays_s)):
            if values:
                ordered = sorted(values)
                figures[f"{name}_p50_s"] = ordered[len(ordered) // 2]
                figures[f"{name}_p99_s"] = ordered[int(0.99 * len(ordered))]
        if self._beat_s is not None:
            figures["heartbeat_age_s"] = self._beat_age_s(now_s)
        if self._good_s is not None:
            figures["last_good_poll_age_s"] = now_s - self._good_s
        return figures

    def _reading(self, values: Mapping[str, float | None], number: int) -> PumpReading:
        readings = {name: values.get(pump_column(number, name)) for name in PUMP_ANALOGUES}
        running = values.get(pump_column(number, "running"))
        fixed_hz = self._plc.device.fixed_frequency_hz
        if fixed_hz is not None and running is not None and pump_column(number, "frequency_hz") not in values:
            readings["frequency_hz"] = fixed_hz if running >= 0.5 else 0.0
        return PumpReading(**readings, running=None if running is None else running >= 0.5)

    def _watch_heartbeat(self, values: Mapping[str, float | None], now_s: float) -> Quality:
        if "heartbeat" not in values:
            return "good"
        beat = values["heartbeat"]
        if self._beat_s is None or (beat is not None and beat != self._beat):
            self._beat, self._beat_s = beat, now_s
        stands = self._beat_age_s(now_s) >= self._plc.device.heartbeat_s
        if stands != self._stands:
            self._stands = stands
            log.warning("station '%s': heartbeat %s", self._plc.station, "stands" if stands else "counts again")
        if not stands:
            return "good"
        self.counts["heartbeat_stood"] += 1
        return self._plc.device.heartbeat_quality

    def _beat_age_s(self, now_s: float) -> float:
        return now_s - (now_s if self._beat_s is None else self._beat_s)

    def _note_refusals(self, refused: Mapping[str, str]) -> None:
        self.counts["refused_values"] += len(refused)
        for name in refused.keys() - self._refused.keys():
            log.warning("station '%s': %s: %s", self._plc.station, name, refused[name])
        self._refused = refused
