"""From what a site shows to what is wrong with it. Pure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.status import Status
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.services.doctor.finding import Finding, Level
from wetwell.services.doctor.survey import Survey
from wetwell.services.runtime.health.board import figure_faults

MAX_SKEW_S = 60.0
LEAST_STRETCH_S = 1.0
MAX_VERDICT_AGE_S = 86_400.0
LEAST_FREE_BYTES = 1_000_000_000
NEEDED_SERVICES = {
    "historian": "nothing is kept; start it: wetwell historian",
    "alarms": "nobody is called; start it: wetwell alarms",
    "watch": "nobody compares stations with their simulators; start it: wetwell gap watch --station FILE",
    "dashboard": "there is no page; start it: wetwell dashboard",
}


def findings_of(survey: Survey, expected: Sequence[str], max_sample_age_s: float) -> Iterator[Finding]:
    """All that a survey shows, station by station, then the services of the site.

    Parameters
    ----------
    survey : Survey
    expected : sequence of str
        Stations that must be there.
    max_sample_age_s : float
        From `health.max_sample_age_s`, for the figures of the services. [s]
    """
    stations = sorted(survey.stations | set(expected))
    if not stations:
        yield Finding(
            "samples", "error", "no station is on the bus", "start a source: wetwell gateway, simulator or replay"
        )
    for station in stations:
        yield from _samples(survey, station)
        yield from _detector(survey, station)
        yield _history(survey, station)
    yield from _services(survey)
    yield from _alarms(survey)
    for (station, service), status in sorted(survey.statuses.items()):
        yield from _figures(survey, station, service, status, max_sample_age_s)


def _samples(survey: Survey, station: str) -> Iterator[Finding]:
    heard = survey.samples.get(station)
    if not heard:
        yield from _unheard(survey, station)
        return
    last_ns, last = heard[-1]
    stretch = _stretch(heard, survey.seconds)
    told = f"{len(heard)} samples in one message" if stretch is None else f"{stretch.rate:.1f} samples a second"
    yield Finding("samples", "ok", f"station '{station}': {told}, last {to_iso(last.time)}")
    if stretch is not None and stretch.is_fast:
        text = f"station '{station}': its time runs {stretch.pace:.0f} times as fast as life"
        yield Finding("clock", "ok", f"{text}, so its clock is not compared")
    else:
        skew_s = (last.time - last_ns) / NS_PER_S
        level: Level = "ok" if abs(skew_s) <= MAX_SKEW_S else "warning"
        advice = (
            "" if level == "ok" else "set the clock of PLC or gateway (NTP), or let the gateway stamp the samples"
        )
        if advice and stretch is None:
            advice += "; if it runs faster than life, --seconds long enough for two of its messages show it"
        yield Finding("clock", level, f"station '{station}': samples are {skew_s:+.1f} s from this clock", advice)
    yield from _quality(station, [sample for _, sample in heard])


def _unheard(survey: Survey, station: str) -> Iterator[Finding]:
    """No message came: a station that gathers its samples may be between two of them."""
    simulator = survey.statuses.get((station, "simulator"))
    if simulator is not None and simulator.figures.get("held", 0.0) > 0.0:
        yield Finding("samples", "ok", f"station '{station}': its simulated plant stands until it is let go")
        return
    advice = "nothing publishes it: start its gateway"
    source = next((name for name in ("gateway", "simulator", "replay") if (station, name) in survey.alive), None)
    if source:
        advice = f"the {source} runs: look at its log"
    if gathered := survey.gathered.get(station):
        (asked_ns, first), (_, last) = gathered[0], gathered[-1]
        age_s = survey.seconds + (asked_ns - last.time) / NS_PER_S
        if -MAX_SKEW_S <= age_s <= (last.time - first.time) / NS_PER_S + MAX_SKEW_S:
            text = f"station '{station}': {len(gathered)} samples in its last message, last {to_iso(last.time)}"
            yield Finding("samples", "ok", text)
            yield from _quality(station, [sample for _, sample in gathered])
            return
        advice += f"; its last message ends {to_iso(last.time)}: if it gathers for longer, listen longer: --seconds"
    yield Finding("samples", "error", f"station '{station}': no sample within {survey.seconds:g} s", advice)


@dataclass(frozen=True)
class _Stretch:
    """So many samples came within a time of the wall, and how long that was for the station."""

    samples: int
    wall_s: float
    station_s: float

    @property
    def rate(self) -> float:
        return self.samples / self.wall_s

    @property
    def pace(self) -> float:
        return self.station_s / self.wall_s

    @property
    def is_fast(self) -> bool:
        return self.station_s > 2.0 * self.wall_s + 2.0


def _stretch(heard: Sequence[tuple[int, Sample]], seconds: float) -> _Stretch | None:
    """Of single samples all the time of listening; of gathered ones that between the first message and the last.

    None where only one message was heard: nobody knows how long its samples were gathered.
    """
    (first_ns, first), (last_ns, last) = heard[0], heard[-1]
    if len({heard_ns for heard_ns, _ in heard}) == len(heard):
        return _Stretch(len(heard), seconds, (last.time - first.time) / NS_PER_S)
    wall_s = (last_ns - first_ns) / NS_PER_S
    if wall_s < LEAST_STRETCH_S:
        return None
    in_first = sum(heard_ns == first_ns for heard_ns, _ in heard)
    return _Stretch(len(heard) - in_first, wall_s, (last.time - heard[in_first - 1][1].time) / NS_PER_S)


def _quality(station: str, samples: Sequence[Sample]) -> Iterator[Finding]:
    bad = sum(sample.quality != "good" for sample in samples) / len(samples)
    if bad > 0.0:
        text = f"station '{station}': {bad:.0%} of the samples are not of good quality"
        yield Finding("quality", "warning", text, "see the gateway's log: heartbeat, exceptions of the PLC")
    missing = [name for name in ("level_m",) if all(getattr(sample, name) is None for sample in samples)]
    for number in range(1, len(samples[-1].pumps) + 1):
        readings = [sample.pumps[number - 1] for sample in samples if len(sample.pumps) >= number]
        missing += [
            pump_column(number, name)
            for name in ("frequency_hz", "flow_m3h", "head_m")
            if all(getattr(reading, name) is None for reading in readings)
        ]
    if missing:
        text = f"station '{station}': never a value of {', '.join(missing)}"
        yield Finding("quality", "warning", text, "check register map and meter; without them faults stay unknown")
    elif bad == 0.0:
        yield Finding("quality", "ok", f"station '{station}': all needed values are there")


def _detector(survey: Survey, station: str) -> Iterator[Finding]:
    if (station, "detector") not in survey.alive:
        advice = "nobody judges it; start one: wetwell detector --station FILE"
        yield Finding("detector", "error", f"station '{station}': no detector is running", advice)
    verdicts = [verdict for (name, _), verdict in sorted(survey.verdicts.items()) if name == station]
    if not verdicts:
        text = f"station '{station}': no verdict yet"
        yield Finding("verdicts", "warning", text, "it comes with the end of the first run of a pump")
    last = survey.last_sample(station)
    for verdict in verdicts:
        age_s = 0.0 if last is None else (last.time - verdict.time) / NS_PER_S
        text = f"station '{station}' pump {verdict.pump}: {verdict.state}, {max(age_s, 0.0) / 3600:.1f} h ago"
        if age_s > MAX_VERDICT_AGE_S:
            advice = "has the pump run? is the detector the one of this station?"
            yield Finding("verdicts", "warning", text, advice)
        else:
            yield Finding("verdicts", "ok", text)


def _history(survey: Survey, station: str) -> Finding:
    history = survey.histories.get(station)
    if history is None:
        is_error = (SITE, "historian") in survey.alive
        advice = "it runs but does not answer: look at its log" if is_error else "start it: wetwell historian"
        level: Level = "error" if is_error else "warning"
        return Finding("history", level, f"station '{station}': the historian does not answer", advice)
    if history.error:
        return Finding("history", "error", f"station '{station}': {history.error}", "look at the historian's log")
    return Finding("history", "ok", f"station '{station}': the historian answers")


def _services(survey: Survey) -> Iterator[Finding]:
    for service, advice in NEEDED_SERVICES.items():
        if (SITE, service) in survey.alive:
            yield Finding("services", "ok", f"{service} is running")
        else:
            yield Finding("services", "warning", f"{service} is not running", advice)


def _alarms(survey: Survey) -> Iterator[Finding]:
    if survey.report is None:
        if (SITE, "alarms") in survey.alive:
            yield Finding("alarms", "error", "alarms runs but does not answer", "look at its log")
        return
    standing = ", ".join(f"{count} {state}" for state, count in survey.report.standing.items()) or "none yet"
    yield Finding("alarms", "ok", f"alarms answers; alarms: {standing}")
    if survey.report.rates.get("is_flood"):
        yield Finding("alarms", "warning", "there is an alarm flood", "wetwell alarms report shows which they are")
    for figure in survey.report.chattering:
        text = f"station '{figure.station}': {figure.alarm} chatters, {figure.transitions} changes within the hour"
        yield Finding("alarms", "warning", text, "give it a longer delay (alarms.rules), or shelve it")


def _figures(
    survey: Survey, station: str, service: str, status: Status, max_sample_age_s: float
) -> Iterator[Finding]:
    if (station, service) not in survey.alive:
        return  # the last word of one that has gone
    place = "" if station == SITE else f" of '{station}'"
    faults = figure_faults(status.figures, max_sample_age_s)
    if status.state == "waiting":
        faults.append("waits: what it needs does not answer")
    if status.figures.get("dropped", 0.0) > 0.0:
        faults.append(f"{status.figures['dropped']:.0f} messages dropped since its start: it is too slow")
    free = status.figures.get("disk_free_bytes")
    if free is not None and free < LEAST_FREE_BYTES:
        faults.append(f"only {free / 1e6:.0f} MB are free on its disk")
    for fault in faults:
        yield Finding("health", "error", f"{service}{place}: {fault}", "look at its log and at /healthz")
