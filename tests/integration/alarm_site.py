"""A site of alarms whose clocks stand where a test puts them."""

from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import alarm_key
from wetwell.protocols.messages.alarm import Alarm, AlarmAct, AlarmAnswer
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S, from_iso
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.runtime.settings import AlarmSettings

START_NS = from_iso("2026-01-01T00:00:00Z")


class Site:
    """A service whose clocks stand where the test puts them; it can be killed."""

    def __init__(self, folder=None, stations=(), **settings) -> None:
        self.bus = MemoryBus()
        self.wall_s = 0.0
        self.seq = 0
        self.told: list[Alarm] = []
        self.settings = AlarmSettings(state_dir=folder, **settings)
        self.stations = stations
        self.start()

    def start(self) -> None:
        self.service = AlarmService(self.bus, self.settings, self.stations, self.now)
        self._listener = self.bus.subscribe(alarm_key("*"))

    def now(self) -> Now:
        return Now(START_NS + round(self.wall_s * NS_PER_S), self.wall_s)

    def sample(self, level_m=1.0, at_s=None, seq=None, quality="good", station="alpha") -> list[tuple[str, str]]:
        self.seq += 1
        time_ns = START_NS + round((self.wall_s if at_s is None else at_s) * NS_PER_S)
        sample = Sample(
            station=station,
            seq=self.seq if seq is None else seq,
            time=time_ns,
            level_m=level_m,
            pumps=(PumpReading(),),
            quality=quality,
        )
        self.service.handle_sample(sample.encode())
        return self.news()

    def verdict(self, state, at_s=None, pump=2, **evidence) -> list[tuple[str, str]]:
        time_ns = START_NS + round((self.wall_s if at_s is None else at_s) * NS_PER_S)
        verdict = Verdict(
            time=time_ns,
            station="alpha",
            pump=pump,
            state=state,
            probability={state: 0.995},
            evidence=evidence,
            window=(time_ns, time_ns),
        )
        self.service.handle_verdict(verdict.encode())
        return self.news()

    def look(self, after_s=0.0) -> list[tuple[str, str]]:
        self.wall_s += after_s
        self.service.look()
        return self.news()

    def act(self, act, alarm="pump2.pump_fault", **fields) -> AlarmAnswer:
        base = {"id": f"act-{self.wall_s}", "station": "alpha", "alarm": alarm, "act": act, "by": "ann"}
        answer = self.service.carry_out(AlarmAct.model_validate(base | fields))
        self.service.commit()
        return answer

    def news(self) -> list[tuple[str, str]]:
        self.service.commit()
        self.told, mailbox = [], self._listener
        while mailbox._messages:
            self.told.append(Alarm.decode(mailbox._messages.popleft()))
        return [(alarm.id, alarm.state) for alarm in self.told]

    def block(self, size) -> None:
        """The samples of so many seconds until now."""
        samples = [
            Sample(
                station="alpha",
                seq=second,
                time=START_NS + second * NS_PER_S,
                level_m=1.0,
                pumps=(PumpReading(),),
            )
            for second in range(round(self.wall_s) - size + 1, round(self.wall_s) + 1)
        ]
        self.service.handle_sample_block(SampleBlock.of(samples).encode())
