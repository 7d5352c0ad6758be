"""What is remembered of one pump from run to run."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from wetwell.detector.baseline.healthy_reference import HealthyReference, learn_check, log_power
from wetwell.detector.baseline.learning import Learning
from wetwell.detector.baseline.model import Baseline
from wetwell.detector.curves.datasheet import Curve
from wetwell.detector.inference.onset import onset_s
from wetwell.detector.inference.prior import PumpPrior
from wetwell.detector.runs.run import Run
from wetwell.detector.sensors.missing_signals import MissingSignals
from wetwell.detector.sensors.sensor_noise import healthy_noise, reading_noise
from wetwell.detector.statistics.cusum import Cusum
from wetwell.detector.verdict.asset_faults import Meter
from wetwell.detector.verdict.control_limits import ControlLimits
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import State
from wetwell.protocols.timestamps import NS_PER_S

RECENT_RUNS = 12
LEARNING_VALUES = 500


@dataclass(slots=True)
class PumpMemory:
    """Memory of one pump, as it stands in a snapshot.

    Attributes
    ----------
    learning : Learning
        The learning phase; None when it is over.
    reference, previous : HealthyReference
        The baseline in use, and the one that a re-baseline has put aside.
    prior : PumpPrior
    state : State
        What was told last.
    onset_ns : int
        Estimate of when the fault began that is told.
    missing_signals : MissingSignals
        What is watched while head or frequency is not measured.
    early : State
        Fault that the last look at an open run was sure of.
    wrong_meters : dict
        Those that the last run has shown to be wrong, by name.
    sees_flow_of_each : bool
        Whether its flow was ever measured while another pump ran on its main.
    """

    learning: Learning | None = field(default_factory=Learning)
    began_s: float = 0.0
    reference: HealthyReference | None = None
    previous: HealthyReference | None = None
    versions: int = 0
    prior: PumpPrior = field(default_factory=PumpPrior)
    state: State = "learning"
    onset_ns: int | None = None
    early: State | None = None
    missing_signals: MissingSignals = field(default_factory=MissingSignals)
    cusum: Cusum = field(default_factory=Cusum)
    limits: ControlLimits = field(default_factory=ControlLimits)
    log_ratios: deque[float] = field(default_factory=lambda: deque(maxlen=LEARNING_VALUES))
    log_powers: deque[float] = field(default_factory=lambda: deque(maxlen=LEARNING_VALUES))
    noises: deque[Floats] = field(default_factory=lambda: deque(maxlen=LEARNING_VALUES))
    recent: deque[tuple[int, Floats]] = field(default_factory=lambda: deque(maxlen=RECENT_RUNS))
    wrong_meters: dict[str, Meter] = field(default_factory=dict)
    sees_flow_of_each: bool = False

    @property
    def offset_m(self) -> float | None:
        """r_p of the pump, learnt or being learnt; None while there is nothing to tell it from. [m]."""
        if self.reference is not None:
            return float(self.reference.baseline.offset_m[0])
        return self.learning.offset_m if self.learning is not None else None

    def learn(self, learning: Learning, run: Run, curve: Curve, friction_h2_m5: float) -> Baseline | None:
        """Take a run of the learning phase into account; the baseline if that can end it."""
        learning.add(run.segments, run.seen_s - self.began_s)
        self.log_ratios.append(run.log_ratio)
        self.log_powers.append(log_power(run))
        self.noises.append(reading_noise(run))
        found = learning.baseline(run.seen_s - self.began_s, curve, friction_h2_m5)
        return None if found is None else found[0]

    def settle(self, learning: Learning, baseline: Baseline, now_ns: int, seen_s: float) -> None:
        """End the learning phase with this baseline."""
        self.versions += 1
        self.reference = HealthyReference(
            version=self.versions,
            learnt_ns=now_ns,
            baseline=baseline,
            drawdown=learn_check(self.log_ratios),
            power=learn_check(self.log_powers),
            noise=healthy_noise(self.noises),
        )
        self.limits = ControlLimits()
        for segments in learning.runs(seen_s - self.began_s, float("inf")):
            self.limits.add(segments, baseline)
        self.learning = None
        self._forget()

    def rebaseline(self, seen_s: float) -> None:
        """Put the baseline aside and learn anew."""
        self.previous, self.reference = self.reference or self.previous, None
        self.learning = Learning()
        self.began_s = seen_s
        self.state = "learning"
        self._begin_anew()

    def revert(self) -> bool:
        """Take the baseline back that was put aside last; False if there is none."""
        if self.previous is None:
            return False
        self.reference, self.previous, self.learning = self.previous, self.reference, None
        self.state = "unknown"
        self._begin_anew()
        return True

    def _begin_anew(self) -> None:
        """Forget what belongs to another baseline."""
        self._forget()
        self.prior = PumpPrior()
        self.onset_ns, self.early = None, None
        self.limits = ControlLimits()
        self.recent.clear()
        self.wrong_meters = {}
        self.missing_signals = MissingSignals()
        self.cusum.reset()

    def _forget(self) -> None:
        """Forget the figures of the learning phase."""
        self.log_ratios.clear()
        self.log_powers.clear()
        self.noises.clear()

    def blame_meters(self, errors: Mapping[str, tuple[float, float]], time_ns: int) -> None:
        """Note which meters are wrong, with relative error and standard deviation; known ones stay so since then."""
        first = dict.fromkeys(errors, (time_ns, 0.0, 0.0)) | self.wrong_meters
        self.wrong_meters = {name: (first[name][0], *error) for name, error in errors.items()}

    def tell(self, state: State, window_ns: tuple[int, int], component: int | None) -> None:
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
