"""What is believed of one asset, a pump or a main: how large its fault is, and whether it was told."""

from dataclasses import dataclass, field

from wetwell.detector.inference.size_track import SizeTrack
from wetwell.protocols.messages.verdict import Stage

CLEARED_SHARE = 0.5
"""A fault that was told stands until less than this share is left of the size with which it was told."""


@dataclass(slots=True)
class AssetBelief:
    """Size of the fault of an asset, and the fault that stands.

    Attributes
    ----------
    track : SizeTrack
        Of a pump the head that it lost at nominal speed; of a main the rise of its friction. [m; 1]
    since_ns : int or None
        Onset of the fault that was told and stands; None without one.
    told_size : float
        The size with which it was told.
    stage : Stage or None
        What was said to do about it.
    scale : float
        Size of usual faults, at the last run.
    flow_m3h, friction_m : float
        Q/N of the pump, and head of friction in health, at the last run.
    log_static : float
        Logarithm of how much better a rise of the static head explains runs at several flows than one of k.
    wasted_kwh : dict
        Energy a day that the fault wastes, by pump (from 0). [kWh/d]
    """

    track: SizeTrack = field(default_factory=SizeTrack)
    since_ns: int | None = None
    told_size: float = 0.0
    stage: Stage | None = None
    scale: float = 1.0
    flow_m3h: float = 0.0
    friction_m: float = 0.0
    log_static: float = 0.0
    wasted_kwh: dict[int, float] = field(default_factory=dict)

    @property
    def is_carried(self) -> bool:
        """Whether the size that is carried is that of the fault which stands: what an early look told is not yet."""
        return self.since_ns is not None and abs(self.track.size[0]) >= CLEARED_SHARE * self.told_size

    def tell(self, onset_ns: int) -> None:
        """Note that the last run has shown the asset to be at fault."""
        if self.since_ns is None:
            self.since_ns, self.told_size = onset_ns, abs(self.track.size[0])

    def look(self) -> None:
        """Note that the last run has shown no fault: one that was told goes if little is left of its size."""
        if self.since_ns is not None and abs(self.track.size[0]) < CLEARED_SHARE * self.told_size:
            self.clear()

    def clear(self) -> None:
        """Let no fault stand any more."""
        self.since_ns, self.told_size, self.stage = None, 0.0, None
        self.wasted_kwh.clear()
