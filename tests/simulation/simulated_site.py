"""A whole site on a virtual clock: PLCs, gateway, bus, detector, historian, alarms; what befalls them, by one seed.

The daemons are the real ones, without their processes: the coroutine that each runs on its bus. What is simulated is
the network, the PLCs, the clock, and what disks do to files.
"""

import asyncio
import contextlib
import contextvars
import logging
import random
from collections import Counter
from collections.abc import Callable, Coroutine, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
from accidents import SLOW_S, Plan
from acts import happen
from judged import Judged
from looks import Looks
from network import Network, Sent, SimulatedBus
from readable import Row, Stock, readable_in, stock_of
from simulated_plc import SimulatedPlc
from virtual_loop import LIFE, Life

from wetwell.protocols import atomic_file
from wetwell.protocols.bus.keys import alarm_key, sample_key, verdict_key
from wetwell.protocols.errors import RecordingError, WetwellError
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S
from wetwell.services.alarms import daemon as alarms_daemon
from wetwell.services.detector.daemon import judge_alone
from wetwell.services.detector.station_detector import VERDICT_HISTORY
from wetwell.services.gateway import daemon as gateway_daemon
from wetwell.services.historian import daemon as historian_daemon
from wetwell.services.historian.rows import pack
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import Batch, Store, StoreError
from wetwell.services.historian.store.opening import open_store
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.settings import (
    AlarmSettings,
    DetectorSettings,
    HealthSettings,
    HistorianSettings,
    Settings,
)
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

FIRST_DAY_NS = 1_735_689_600 * NS_PER_S
HOURS = 24
"""A life begins at one of these of the day: the earlier, the later there is a day that becomes a file."""
EARLIER_DAYS, EARLIER_S = 2, 1_800
"""The history of a site has samples of so many days before its life, one in so many seconds."""
MAINTAIN_S = (3_600, 7_200)
SCRUBBED_AT_ONCE = (2, 10)
"""Parts of a history that are looked through in each pause: few of all, as at a site of many stations, or many."""
COMMIT_PERIODS = (0.5, 2.0)
CHECKPOINT_PERIODS = (6.0, 60.0)
"""How often things are done at a site, of which a seed has rolled one; in periods of the poll."""
KEPT_SAMPLES = (40, 600)
"""So many a gateway keeps for those who come late: 600 are ten minutes of life, but two days of a light site."""
RESTART_S = 10.0
"""After so long a daemon that has ended with an error is started again."""
QUIET_S = 1_800.0
"""Virtual time after the last sample in which everything may settle."""
EARLIER_AT_S = -1.0
"""When what was before the life was sent."""
LOOK_S = 60.0
"""Between the looks of the alarms at what is silent: often against samples of a light site."""
IS_ASKED = 0.5
"""Share of sites in which somebody asks for all that is kept: what is read shows, and is mended, earlier."""
STOCK_S = 3_600.0
"""So often somebody looks at what the history has."""
MOST_ASKED = 1_000_000
LATE_S = 60.0
"""So long somebody listens then who comes new."""


class Span(NamedTuple):
    """What kept something from working, and how long."""

    what: str
    name: str
    begin_s: float
    end_s: float


class Harm(NamedTuple):
    """What was done to the files of a daemon, and when; samples of a history that could be read afterwards."""

    kind: str
    name: str
    at_s: float
    readable: set[Row]


class Stocktaking(NamedTuple):
    """What the history had at a time, and what was done to its files last before it."""

    at_s: float
    stock: Stock
    harm: Harm | None


class Answer(NamedTuple):
    """What the historian gives out of a station."""

    station: str
    samples: Samples
    verdicts: list[bytes]


class Told(NamedTuple):
    """A warning or an error that a daemon has logged."""

    at_s: float
    logger: str
    text: str


class Process:
    """A daemon that can die, stand and come back; what ends it must end before it is there again."""

    def __init__(self, site: "Site", name: str, work: Callable[[SimulatedBus], Coroutine[Any, Any, None]]) -> None:
        self.name = name
        self._site = site
        self._work = work
        self._away = 1
        self._stalls = 0
        self._gone_s: float | None = 0.0
        self._since_s = 0.0
        self._cut_s = {"mute": 0.0, "deaf": 0.0}
        self.bus: SimulatedBus | None = None
        self.task: asyncio.Task[None] | None = None
        self.life = Life(name)

    def start_again(self) -> None:
        """Begin, with a connection of its own, when nothing else keeps it down."""
        self._away -= 1
        if not self._away:
            self._begin()

    def _begin(self) -> None:
        assert self._gone_s is not None
        self._site.spans.append(Span("away", self.name, self._gone_s, _now_s()))
        self._gone_s, self._since_s = None, _now_s()
        self.bus = self._site.network.join(self.name)
        self.bus.mute_s, self.bus.deaf_s = self._cut_s["mute"], self._cut_s["deaf"]
        self.life = Life(self.name, disk_s=self._site.disk_s)
        context = contextvars.copy_context()
        context.run(LIFE.set, self.life)
        self.task = asyncio.create_task(self._run(self.bus), name=self.name, context=context)
        if self._stalls:
            self._since_s = float("inf")  # it has done nothing yet, nor holds its folder
            self._stand()

    async def _run(self, bus: SimulatedBus) -> None:
        """Work; what ends with an error is begun again after a while, as systemd does."""
        try:
            await self._work(bus)
        except* WetwellError:
            pass  # one line and no daemon
        except* Exception as errors:  # noqa: BLE001 -- told as a broken rule
            if not self.life.is_dead:
                self._site.crashes.append(f"{self.name}: {_leaf(errors)!r}")
        bus.kill()
        if self._gone_s is None:
            self._gone_s = _now_s()
            asyncio.get_running_loop().call_later(RESTART_S, self._revive, self.life, context=contextvars.Context())

    def _revive(self, life: Life) -> None:
        if not self._away and self.life is life:
            self._begin()

    async def kill(self) -> None:
        """End it as SIGKILL does: nothing is sent or saved any more."""
        if self._begin_to_be_away():
            assert self.bus is not None
            self.life.is_dead = True
            self.bus.kill()
            await self._end()

    async def stop(self) -> None:
        """End it as SIGTERM does; one that stands is killed instead, as by whoever has waited for it."""
        if self._stalls:
            await self.kill()
        elif self._begin_to_be_away():
            assert self.bus is not None
            await self._end()
            self.bus.kill()

    def stall(self) -> None:
        """Let it stand, as SIGSTOP does: its connection is silent too."""
        self._stalls += 1
        if not self._away:
            self._stand()

    @property
    def lived_s(self) -> float:
        """For how long it has been there since it began to work; 0 or less while it is not. [s]"""
        return 0.0 if self.task is None or self.task.done() else _now_s() - self._since_s

    def go_on(self) -> None:
        """End one stall; it goes on when there is no other."""
        self._stalls -= 1
        if self._stalls or self._away or self.bus is None:
            return
        self.bus.mute_s, self.bus.deaf_s = self._cut_s["mute"], self._cut_s["deaf"]
        self._since_s = min(self._since_s, _now_s())
        self.life.go_on()

    def cut(self, seconds: float, *, is_mute: bool, is_deaf: bool) -> None:
        """Cut its link for a while, whether it lives or not."""
        for way, is_cut in (("mute", is_mute), ("deaf", is_deaf)):
            if is_cut:
                self._cut_s[way] = max(self._cut_s[way], _now_s() + seconds)
        if self.bus is not None:
            self.bus.cut(seconds, is_mute=is_mute, is_deaf=is_deaf)

    def _stand(self) -> None:
        assert self.bus is not None
        self._site.looks.matter()  # one that is due meanwhile comes when it goes on
        self.life.is_stalled = True
        self.bus.mute_s = self.bus.deaf_s = float("inf")

    def _begin_to_be_away(self) -> bool:
        """Whether it was there until now."""
        self._away += 1
        if self._away > 1 or self._gone_s is not None:
            return False
        self._gone_s = _now_s()
        return True

    async def _end(self) -> None:
        assert self.task is not None
        if self.life.is_stalled:
            self.life.go_on()
        self.task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await self.task


@dataclass
class Site:
    """Stations that are polled every `period_s` of virtual time, and the daemons that deal with them.

    Attributes
    ----------
    told : dict
        Verdicts that were heard, by station, each payload once, with the times at which it was heard.
    alarms : dict
        Alarms that were heard, by station and id, in order, repeats left out.
    accidents : list of str
        What has happened, in order.
    spans, harms : list
        When what could not work, and what was done to files.
    stocks : list
        What the history had from time to time, and before its files were harmed.
    answers : list
        What the historian gave out then, where somebody asks.
    crashes : list of str
        Errors of the program itself that have ended a daemon, and pairs that worked on one folder.
    told_late : set of (str, str)
        Alarms that one hears of who comes at the end, by station and id.
    verdicts_late : set of bytes
        Verdicts that one hears of who comes at the end.
    log : list of Told
        What the operator was told by the logs.
    judged : Judged
        What the detector was given.
    """

    seed: int
    stations: Sequence[Station]
    scenario: Scenario
    seconds: int
    period_s: int
    folder: Path
    plan: Plan
    told: dict[str, dict[bytes, Verdict]] = field(default_factory=dict)
    heard_s: dict[bytes, list[float]] = field(default_factory=dict)
    alarms: dict[tuple[str, str], list[Alarm]] = field(default_factory=dict)
    accidents: list[str] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    harms: list[Harm] = field(default_factory=list)
    stocks: list[Stocktaking] = field(default_factory=list)
    answers: list[Answer] = field(default_factory=list)
    crashes: list[str] = field(default_factory=list)
    log: list[Told] = field(default_factory=list)
    told_late: set[tuple[str, str]] = field(default_factory=set)
    verdicts_late: set[bytes] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.dice = random.Random(self.seed)
        self.network = Network(self.dice)
        self.judged = Judged()
        self.looks = Looks()
        self.strains: Counter[str] = Counter()
        self.clock_s = 0.0
        self.kept_samples = self.dice.choice(KEPT_SAMPLES)
        self.is_asked = self.dice.random() < IS_ASKED
        self.store: Store | None = None
        self.scrubbed_at_once = self.dice.choice(SCRUBBED_AT_ONCE)
        self.start_ns = FIRST_DAY_NS + self.dice.randrange(HOURS) * 3_600 * NS_PER_S
        self.settings = Settings(
            health=HealthSettings(period_s=60.0 * self.period_s),
            detector=DetectorSettings(
                state_dir=self.folder / "detector", checkpoint_s=self.dice.choice(CHECKPOINT_PERIODS) * self.period_s
            ),
            alarms=AlarmSettings(
                state_dir=self.folder / "alarms", stale_after_s=5.0 * self.period_s, silent_after_s=600.0
            ),
            historian=HistorianSettings(
                folder=self.folder / "history",
                commit_s=self.dice.choice(COMMIT_PERIODS) * self.period_s,
                maintain_s=self.dice.choice(MAINTAIN_S),
            ),
        )
        self.plcs = {
            station.name: SimulatedPlc(station.name, self._feed(number, station), self.period_s, self.dice)
            for number, station in enumerate(self.stations)
        }
        self._work = {
            "gateway": self._poll,
            "detector": self._detect,
            "historian": self._keep,
            "alarms": self._alarm,
        }
        self.processes = {name: Process(self, name, work) for name, work in self._work.items()}
        self.twins: list[Process] = []

    async def live(self) -> None:
        """Let the site live from the first to the last sample, with its accidents, and become quiet."""
        with self._simulated_world():
            self._keep_earlier()
            observer = Process(self, "observer", self._observe)
            observer.start_again()
            for process in self.processes.values():
                process.start_again()
            async with asyncio.TaskGroup() as group:
                group.create_task(self._take_stock_often(), name="stock")
                group.create_task(happen(self, self.plan), name="accidents")
            await self.processes["gateway"].stop()
            await asyncio.sleep(QUIET_S)
            newcomer = Process(self, "newcomer", self._come_late)
            newcomer.start_again()
            await asyncio.sleep(LATE_S)
            await newcomer.kill()
            for name in ("detector", "alarms", "historian"):
                await self.processes[name].stop()
            await observer.kill()

    async def _take_stock_often(self) -> None:
        """Until the last sample."""
        end_s = self.seconds - 0.5 * self.period_s
        while _now_s() < end_s:
            await asyncio.sleep(min(STOCK_S, end_s - _now_s()))
            self.take_stock()
            if self.is_asked and self.store is not None:
                self._ask(self.store)

    def _ask(self, store: Store) -> None:
        """What cannot be read now is not answered."""
        for station in self.stations:
            with contextlib.suppress(StoreError):
                samples = store.samples(station.name, 0, MAX_STAMP_NS)
                verdicts = store.events("verdicts", station.name, 0, MAX_STAMP_NS, MOST_ASKED)
                self.answers.append(Answer(station.name, samples, verdicts))

    @contextlib.contextmanager
    def heard(self) -> Iterator[None]:
        """Hear the logs when the life is over, too."""
        with _heard_logs(self.log, lambda: self.seconds + QUIET_S):
            yield

    def kept(self) -> FolderStore:
        """What the historian has kept."""
        return FolderStore(self.folder_of("historian"), keep_live_days=1)

    def folder_of(self, name: str) -> Path:
        """Where a daemon keeps what it has."""
        return self.folder / {"historian": "history"}.get(name, name)

    def twin_of(self, name: str) -> Process:
        """A second daemon of one name: it must be refused while the first is there."""
        return Process(self, f"twin of {name}", self._work[name])

    def disk_s(self) -> float:
        """How long a write waits for the disk now. [s]"""
        return SLOW_S if self.strains["slow"] else 0.0

    @contextlib.contextmanager
    def span(self, what: str, name: str) -> Iterator[None]:
        """Note from when to when something could not work."""
        begin_s = _now_s()
        yield
        self.spans.append(Span(what, name, begin_s, _now_s()))

    def harm(self, kind: str, name: str, act: Callable[[Path], bool]) -> None:
        """Let something be done to the files of a daemon, and note it if it was."""
        folder = self.folder_of(name)
        if name == "historian":
            self.take_stock()
        if act(folder):
            readable = readable_in(folder) if name == "historian" else set()
            self.harms.append(Harm(kind, name, _now_s(), readable))
            self.looks.matter()

    def take_stock(self) -> None:
        """Note what the history has now."""
        harms = self.harms_of("historian")
        stock = stock_of(self.folder_of("historian"))
        self.stocks.append(Stocktaking(_now_s(), stock, harms[-1] if harms else None))

    def harms_of(self, name: str) -> list[Harm]:
        """What was done to the files of a daemon."""
        return [harm for harm in self.harms if harm.name == name]

    def _feed(self, number: int, station: Station) -> Recording:
        recording = Simulation(station, self.scenario, self.seed * 1000 + number).advance(self.seconds, truth=False)
        return Recording(
            time_ns=recording.time_ns[:: self.period_s],
            columns={name: column[:: self.period_s] for name, column in recording.columns.items()},
        )

    def _keep_earlier(self) -> None:
        """Let the history begin before the life: by one who is gone."""
        gone = SimulatedBus(self.network, "earlier")
        gone.is_alive, gone.died_s = False, 0.0
        count = EARLIER_DAYS * 86_400 // EARLIER_S
        time_ns = FIRST_DAY_NS - np.arange(count, 0, -1) * EARLIER_S * NS_PER_S
        with open_store(self.settings.historian) as store:
            for name, plc in self.plcs.items():
                columns = {column: values[:count] for column, values in plc.recording.columns.items()}
                samples = list(Recording(time_ns=time_ns, columns=columns).samples(name))
                store.write(Batch([pack(name, sample) for sample in samples]))
                for sample in samples:
                    self.network.note(sample_key(name), Sent(sample.encode(), EARLIER_AT_S, gone))

    async def _poll(self, bus: SimulatedBus) -> None:
        plcs = [simulated.plc for simulated in self.plcs.values()]
        await gateway_daemon.poll_all(bus, plcs, health_s=60.0 * self.period_s, longest_wait_s=30.0)

    async def _detect(self, bus: SimulatedBus) -> None:
        await judge_alone(self.settings, bus, self.stations)

    async def _keep(self, bus: SimulatedBus) -> None:
        kept = self.settings.historian
        with open_store(kept) as store:
            historian = Historian(store, spool_rows=kept.spool_rows)
            self.store = store
            try:
                await historian_daemon.keep(
                    bus, historian, kept.commit_s, kept.maintain_s, self.settings.health.period_s
                )
            finally:
                self.store = None if self.store is store else self.store
                historian.commit(now_ns())

    async def _alarm(self, bus: SimulatedBus) -> None:
        await alarms_daemon.keep_alone(self.settings, bus, self.stations)

    async def _observe(self, bus: SimulatedBus) -> None:
        verdicts = bus.subscribe(verdict_key("*"), capacity=1_000_000)
        alarms = bus.subscribe(alarm_key("*"), capacity=1_000_000)
        async with asyncio.TaskGroup() as group:
            group.create_task(_each(verdicts, self._note_verdict))
            group.create_task(_each(alarms, self._note_alarm))

    async def _come_late(self, bus: SimulatedBus) -> None:
        alarms = bus.subscribe(alarm_key("*"), history=1, capacity=1_000_000)
        verdicts = bus.subscribe(verdict_key("*"), history=VERDICT_HISTORY, capacity=1_000_000)
        async with asyncio.TaskGroup() as group:
            group.create_task(_each(alarms, self._note_late))
            group.create_task(_each(verdicts, self.verdicts_late.add))

    def _note_late(self, payload: bytes) -> None:
        alarm = Alarm.decode(payload)
        self.told_late.add((alarm.station, alarm.id))

    def _note_verdict(self, payload: bytes) -> None:
        verdict = Verdict.decode(payload)
        self.told.setdefault(verdict.station, {}).setdefault(payload, verdict)
        self.heard_s.setdefault(payload, []).append(_now_s())

    def _note_alarm(self, payload: bytes) -> None:
        alarm = Alarm.decode(payload)
        heard = self.alarms.setdefault((alarm.station, alarm.id), [])
        if not heard or heard[-1] != alarm:
            heard.append(alarm)

    @contextlib.contextmanager
    def _simulated_world(self) -> Iterator[None]:
        """Clock, PLC connections, disks and logs of this site in place of the real ones."""
        loop = asyncio.get_running_loop()
        write = FolderStore.write
        real = atomic_file.atomic_file

        def time_ns() -> int:
            return self.start_ns + round((loop.time() + self.clock_s) * NS_PER_S)

        def is_lost() -> bool:
            life = LIFE.get()
            return self.strains["full"] > 0 or (life is not None and life.is_dead)

        def keep(store: FolderStore, batch: Batch) -> int:
            if is_lost():
                raise StoreError("no space left on device (simulated)")
            return write(store, batch)

        @contextlib.contextmanager
        def file(path: Path, *args: Any, **kwargs: Any) -> Iterator[Any]:
            if is_lost():
                raise RecordingError(f"{path}: no space left on device (simulated)")
            with real(path, *args, **kwargs) as opened:
                yield opened

        with contextlib.ExitStack() as patches:
            for target, replacement in (
                ("wetwell.services.runtime.clock.time", SimpleNamespace(time_ns=time_ns)),
                ("wetwell.services.runtime.folder_lock.asyncio", SimpleNamespace(sleep=self.looks.sleep)),
                ("wetwell.services.gateway.poller.connection_to", lambda plc: self.plcs[plc.station].connection()),
                ("wetwell.services.gateway.poller.random", self.dice),
                ("wetwell.services.runtime.sample_sender.LEAST_KEPT", self.kept_samples),
                ("wetwell.services.historian.service.SCRUBBED_AT_ONCE", self.scrubbed_at_once),
                ("wetwell.services.alarms.daemon.LOOK_S", LOOK_S),
                ("wetwell.services.alarms.daemon.SAVE_S", 60.0 * self.period_s),
                ("wetwell.services.runtime.state_file.atomic_file", file),
                ("wetwell.services.detector.quarantine.atomic_file", file),
                ("wetwell.services.historian.store.archive.atomic_file", file),
                ("wetwell.services.historian.store.folder_store.FolderStore.write", keep),
            ):
                patches.enter_context(mock.patch(target, replacement))
            patches.enter_context(self.judged.watched())
            patches.enter_context(_heard_logs(self.log, _now_s))
            yield


class _Listener(logging.Handler):
    def __init__(self, log: list[Told], now_s: Callable[[], float]) -> None:
        super().__init__(logging.WARNING)
        self._log = log
        self._now_s = now_s

    def emit(self, record: logging.LogRecord) -> None:
        self._log.append(Told(self._now_s(), record.name, record.getMessage()))


@contextlib.contextmanager
def _heard_logs(log: list[Told], now_s: Callable[[], float]) -> Iterator[None]:
    logger, listener = logging.getLogger("wetwell"), _Listener(log, now_s)
    before = logger.level, logger.propagate
    logger.setLevel(logging.WARNING)
    logger.propagate = False
    logger.addHandler(listener)
    try:
        yield
    finally:
        logger.removeHandler(listener)
        logger.setLevel(before[0])
        logger.propagate = before[1]


def _leaf(error: BaseException) -> BaseException:
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error


async def _each(subscription: Any, note: Callable[[bytes], None]) -> None:
    while True:
        for payload in await subscription.receive():
            note(payload)


def _now_s() -> float:
    return asyncio.get_running_loop().time()
