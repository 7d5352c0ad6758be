"""A pump run: its steady samples, and their means over segments."""

import math
from dataclasses import dataclass, field

from wetwell.detector.stream.steady_samples import SEGMENT_SAMPLES
from wetwell.protocols.arrays import Floats


@dataclass(frozen=True, slots=True)
class Segments:
    """Means over steady samples, m of them: 25 samples each, or what a slow feed has in `SEGMENT_S`.

    Attributes
    ----------
    residual_m : (m, 2) array
        Level residuals (r_p, r_s). [m]
    flow_m3h, total_m3h : (m,) arrays
        Q/N of the pump and flow of the main, as measured. [m³/h]
    duty_m3h, duty_total_m3h : (m,) arrays
        The same by the datasheet, for the pumps that run and their speeds: free of the noise of the meters. [m³/h]
    level_m : (m,) array
        NaN where the level is not known. [m]
    speed_ratio : (m,) array
    samples : int
        In each segment.
    """

    residual_m: Floats
    flow_m3h: Floats
    total_m3h: Floats
    duty_m3h: Floats
    duty_total_m3h: Floats
    level_m: Floats
    speed_ratio: Floats
    samples: int = SEGMENT_SAMPLES

    def __len__(self) -> int:
        return len(self.flow_m3h)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """The steady samples of one run of one pump, or of a part of a long one.

    Attributes
    ----------
    pump : int
        From 0.
    window_ns : (first, last) stamp of the run
    time_s, flow_m3h, head_m, speed_ratio, total_flow_m3h, level_m, power_kw : (n,) arrays
        Steady samples that have flow, head and frequency; time since the start of the run. Level, power may be NaN.
    segments : Segments
    missing : frozenset of str
        Signals that no sample of the run had.
    stuck : list of str
        Readings that were stuck in it.
    log_ratio : float
        Logarithm of metered flow over drawdown flow; NaN without a drawdown.
    run_s, seen_s : float
        Time that the pump has run in all, and that the station has been seen. [s]
    running : int
        Number of pumps that ran in its last segment without a signal.
    step_s : float
        Usual step of the feed; 0 where it is not known. [s]
    lacks_head : bool
        Whether `head_m` is what the main takes by the datasheet, in place of a reading.
    lacked_flow_alone : bool
        Whether the flow was missing in a sample in which no other pump of the main ran.
    """

    pump: int
    window_ns: tuple[int, int]
    time_s: Floats
    flow_m3h: Floats
    head_m: Floats
    speed_ratio: Floats
    total_flow_m3h: Floats
    level_m: Floats
    power_kw: Floats
    segments: Segments
    missing: frozenset[str]
    stuck: list[str] = field(default_factory=list)
    log_ratio: float = math.nan
    run_s: float = 0.0
    seen_s: float = 0.0
    running: int = 0
    step_s: float = 0.0
    lacks_head: bool = False
    lacked_flow_alone: bool = False
