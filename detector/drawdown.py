"""Drawdown: what a pump takes out of the wet well, against what its flow meter says."""

import math
from dataclasses import dataclass, field

from wetwell.detector.gate import Frame
from wetwell.detector.runs import USUAL_GAPS
from wetwell.protocols.stamps import NS_PER_S

SETTLED_S = 15.0
MIN_S = 60.0
MIN_SAMPLES = 4
MAX_S = 600.0
"""A longer phase begins anew, so that the inflow before a run is that just before it."""
MAX_AGE_S = 600.0
MAX_GAP_S = 10.0
DEAD_RATIO = 0.01
"""Metered over drawdown flow of a meter that reads nothing."""


@dataclass(slots=True)
class Phase:
    """Running sums while the same pumps run; the slope of the level comes from them."""

    running: tuple[bool, ...]
    begin_ns: int
    end_ns: int = 0
    samples: int = 0
    time: float = 0.0
    level: float = 0.0
    time_time: float = 0.0
    time_level: float = 0.0
    came_m: float = 0.0
    flow: float = 0.0

    def add(self, time_ns: int, level_m: float, inflow_m_s: float, flow_m3h: float) -> None:
        """Take one reading into account."""
        time_s = (time_ns - self.begin_ns) / NS_PER_S
        self.came_m += inflow_m_s * (time_ns - self.end_ns) / NS_PER_S if self.samples else 0.0
        level_m -= self.came_m
        self.end_ns = time_ns
        self.samples += 1
        self.time += time_s
        self.level += level_m
        self.time_time += time_s * time_s
        self.time_level += time_s * level_m
        self.flow += flow_m3h

    @property
    def slope_m_h(self) -> float:
        """Rise of the level, without what the inflow has brought, by least squares. [m/h]."""
        spread = self.time_time - self.time * self.time / self.samples
        if spread <= 0.0:
            return math.nan
        return 3600.0 * (self.time_level - self.time * self.level / self.samples) / spread


@dataclass(slots=True)
class Drawdown:
    r"""Ratio of the metered flow to the drawdown flow, for runs of one pump alone after a time without any.

    $$\rho = \ln \frac{Q}{A (\dot Y_{idle} - \dot Y_{run})}, \qquad Y = L - \frac{1}{A} \int Q_{in}\, dt$$

    Where the inflow is not measured it is left out of Y: then it has to be the same before and during the run, and
    the time without any pump must lie just before. Only changes of ρ count, so that A need not be right.

    Memory: constant.

    Parameters
    ----------
    area_m2 : float
        A. [m²]
    """

    area_m2: float
    _gap_s: float = 0.0
    _phase: Phase | None = None
    _idle: Phase | None = None
    _log_ratio: dict[int, float] = field(default_factory=dict)

    def update(self, frame: Frame, running: tuple[bool, ...]) -> None:
        """Take a frame into account, in which these pumps ran."""
        phase = self._phase
        is_next = frame.gap_s <= MAX_GAP_S or frame.gap_s <= USUAL_GAPS * self._gap_s
        self._gap_s = frame.gap_s
        if phase is None or phase.running != running or not is_next:
            self._end()
            phase = self._phase = Phase(running, frame.time_ns)
        elif frame.time_ns - phase.begin_ns >= MAX_S * NS_PER_S and not any(running):
            self._end()
            phase = self._phase = Phase(running, frame.time_ns - int(SETTLED_S * NS_PER_S))
        if frame.time_ns - phase.begin_ns < SETTLED_S * NS_PER_S or math.isnan(frame.level_m):
            return
        flow_m3h = 0.0
        for pump, is_running in zip(frame.pumps, running, strict=True):
            if is_running:
                flow_m3h += pump.flow_m3h
        inflow_m_s = 0.0 if math.isnan(frame.inflow_m3h) else frame.inflow_m3h / 3600.0 / self.area_m2
        phase.add(frame.time_ns, frame.level_m, inflow_m_s, flow_m3h)

    def take(self, pump: int) -> float:
        """ρ of the last run of a pump, once; NaN where there is none."""
        return self._log_ratio.pop(pump, math.nan)

    def _end(self) -> None:
        """Keep what the phase that ends has told."""
        phase = self._phase
        if phase is None or phase.samples < MIN_SAMPLES or phase.end_ns - phase.begin_ns < MIN_S * NS_PER_S:
            return
        if not any(phase.running):
            self._idle = phase
            return
        idle = self._idle
        is_alone = sum(phase.running) == 1
        if not is_alone or idle is None or (phase.begin_ns - idle.end_ns) / NS_PER_S > MAX_AGE_S:
            return
        drawn_m3h = self.area_m2 * (idle.slope_m_h - phase.slope_m_h)
        flow_m3h = phase.flow / phase.samples
        if drawn_m3h > 0.0:
            self._log_ratio[phase.running.index(True)] = math.log(max(flow_m3h / drawn_m3h, DEAD_RATIO))
