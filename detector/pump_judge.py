"""What the detector knows of one pump."""

from collections import deque
from dataclasses import dataclass, field

from wetwell.detector.baseline.learning import Learning
from wetwell.detector.baseline.model import Baseline, Curve
from wetwell.detector.inference.observation import Check, learn_check, log_power
from wetwell.detector.inference.onset import onset_s
from wetwell.detector.inference.prior import PumpBelief
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.cusum import Cusum
from wetwell.detector.stream.missing_signals import BlindWatch
from wetwell.detector.stream.stuck_sensors import healthy_noise, reading_noise
from wetwell.detector.verdict.control_limits import IndexLimits
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.messages import State
from wetwell.protocols.timestamps import NS_PER_S

ROLLING_SAMPLES = 300
RECENT_RUNS = 12
LEARNING_VALUES = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class Knowledge:
    """A learnt baseline with all that was learnt beside it.

    Attributes
    ----------
    version : int
        From 1; each learning phase adds one.
    learnt_ns : int
        Stamp of the end of the learning phase.
    baseline : Baseline
    drawdown, power : Check
    noise : (2,) array
        Of flow and head from second to second, as shares of their means.
    """

    version: int
    learnt_ns: int
    baseline: Baseline
    drawdown: Check
    power: Check
    noise: Floats


@dataclass(slots=True)
class PumpRecord:
    """State of one pump.

    Attributes
    ----------
    learning : Learning
        The learning phase; None when it is over.
    known, previous : Knowledge
        The baseline in use, and the one that a re-baseline has put aside.
    belief : PumpBelief
    state : State
        What was told last.
    onset_ns : int
        Estimate of when the fault began that is told.
    blind : BlindWatch
        What is watched while head or frequency is not measured.
    early : State
        Fault that the last look at an open run was sure of.
    """

    learning: Learning | None = field(default_factory=Learning)
    began_s: float = 0.0
    known: Knowledge | None = None
    previous: Knowledge | None = None
    versions: int = 0
    belief: PumpBelief = field(default_factory=PumpBelief)
    state: State = "learning"
    onset_ns: int | None = None
    early: State | None = None
    blind: BlindWatch = field(default_factory=BlindWatch)
    cusum: Cusum = field(default_factory=Cusum)
    limits: IndexLimits = field(default_factory=IndexLimits)
    log_ratios: deque[float] = field(default_factory=lambda: deque(maxlen=LEARNING_VALUES))
    log_powers: deque[float] = field(default_factory=lambda: deque(maxlen=LEARNING_VALUES))
    noises: deque[Floats] = field(default_factory=lambda: deque(maxlen=LEARNING_VALUES))
    recent: deque[tuple[int, Floats]] = field(default_factory=lambda: deque(maxlen=RECENT_RUNS))

    @property
    def offset_m(self) -> float | None:
        """r_p of the pump, learnt or being learnt; None while there is nothing to tell it from. [m]."""
        if self.known is not None:
            return float(self.known.baseline.offset_m[0])
        return self.learning.offset_m if self.learning is not None else None

    def learn(
        self, run: Run, log_ratio: float, seen_s: float, curve: Curve, friction_h2_m5: float
    ) -> Baseline | None:
        """Take a run of the learning phase into account; the baseline if that can end it."""
        if self.learning is None:
            return None
        self.learning.add(run.segments, seen_s - self.began_s)
        self.log_ratios.append(log_ratio)
        self.log_powers.append(log_power(run))
        self.noises.append(reading_noise(run))
        found = self.learning.baseline(seen_s - self.began_s, curve, friction_h2_m5)
        return None if found is None else found[0]

    def settle(self, baseline: Baseline, now_ns: int, seen_s: float) -> None:
        """End the learning phase with this baseline."""
        if self.learning is None:
            return
        self.versions += 1
        self.known = Knowledge(
            version=self.versions,
            learnt_ns=now_ns,
            baseline=baseline,
            drawdown=learn_check(self.log_ratios),
            power=learn_check(self.log_powers),
            noise=healthy_noise(self.noises),
        )
        self.limits = IndexLimits()
        for segments in self.learning.runs(seen_s - self.began_s, float("inf")):
            self.limits.add(segments, baseline)
        self.learning = None
        self._forget()

    def rebaseline(self, seen_s: float) -> None:
        """Put the baseline aside and learn anew."""
        self.previous, self.known = self.known or self.previous, None
        self.learning = Learning()
        self.began_s = seen_s
        self.state = "learning"
        self._begin_anew()

    def revert(self) -> bool:
        """Take the baseline back that was put aside last; False if there is none."""
        if self.previous is None:
            return False
        self.known, self.previous, self.learning = self.previous, self.known, None
        self.state = "unknown"
        self._begin_anew()
        return True

    def _begin_anew(self) -> None:
        """Forget what belongs to another baseline."""
        self._forget()
        self.belief = PumpBelief()
        self.onset_ns, self.early = None, None
        self.limits = IndexLimits()
        self.recent.clear()
        self.blind = BlindWatch()
        self.cusum.reset()

    def _forget(self) -> None:
        """Forget the figures of the learning phase."""
        self.log_ratios.clear()
        self.log_powers.clear()
        self.noises.clear()

    def take_state(self, state: State, window_ns: tuple[int, int], component: int | None) -> None:
        """Tell a state; of a new fault the onset is estimated from the recent runs and stays."""
        if component is None:
            self.onset_ns = None
        elif self.onset_ns is None:
            first_ns = self.recent[0][0] if self.recent else window_ns[0]
            times_s = [(time_ns - first_ns) / NS_PER_S for time_ns, _ in self.recent]
            shifts_m = [float(shift_m[component]) for _, shift_m in self.recent]
            estimate_ns = first_ns + round(onset_s(times_s, shifts_m)) * NS_PER_S if times_s else window_ns[0]
            self.onset_ns = min(estimate_ns, window_ns[1])
        self.state = state
