"""What is kept of a watched station: its looks, what its gap is called since when, and what it is held against."""

from collections.abc import Sequence
from typing import Literal

from pydantic import BaseModel, ConfigDict

from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.sim2real.diagnosis.report import FoundEffect
from wetwell.sim2real.diagnosis.report_part import Short, ShortInterval

MOST_LOOKS = 400
"""Looks that are kept of a station: a year, one a day."""
MOST_PAST = 50


class _Kept(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class KeptShift(_Kept):
    """Mean of a group with its standard error, in units of what matters."""

    mean: Short
    error: Short
    cycles: int


class KeptLook(_Kept):
    """A look that was taken: the gap of the station file by signal, and the largest shifts.

    `gap` is in units of noise (1 is noise alone); `matters` is the largest shift of a group in units of what matters,
    with its 95 % interval, at `group`. Both count faults that the detector tells as if the file knew of them.
    `drifting` are the groups that differ from the reference by more than noise, in units of what matters, and
    `step_ns` is when one of them changed.
    """

    start_ns: int
    end_ns: int
    gap: dict[str, Short]
    group: str
    matters: Short
    interval: ShortInterval
    drifting: dict[str, Short] = {}
    step_ns: int | None = None


class Called(_Kept):
    """What the gap, or a part of it, is called.

    Attributes
    ----------
    effect : FoundEffect or None
        None where nothing of the library explains it.
    own : FoundEffect or None
        The same by the recording alone: what it says to other stations.
    table : EffectTable or None
        The same, as a station file has it.
    component : str
        The one held responsible.
    probability : float
        Of the verdict that named it.
    since_ns : int or None
        When it began to grow; None where it was there at the first look.
    named_ns : int
        End of the look at which it was named last.
    span_s : float
        Length of the recording that it was named on. [s]
    fault : str or None
        The asset as whose fault the detector tells it, such as `main`: then it is no gap of the model.
    before : dict of str to KeptShift
        What the station was held against before.
    """

    effect: FoundEffect | None
    own: FoundEffect | None
    table: EffectTable | None
    component: str
    probability: Short
    since_ns: int | None
    named_ns: int
    span_s: float
    fault: str | None = None
    before: dict[str, KeptShift]

    @property
    def name(self) -> str | None:
        """Name of its effect; None of what nothing explains."""
        return None if self.effect is None else self.effect.name


class Ended(_Kept):
    """What is over: it was called so from `since_ns` until `ended_ns`."""

    called: Called
    ended_ns: int


class WatchState(_Kept):
    """All that is kept of a station.

    Attributes
    ----------
    station : Station
        The file that it is held against; another file begins anew.
    looked_ns : int or None
        End of the last look.
    reference : dict of str to KeptShift
        Groups as they were when it was named last, under the file and what is called.
    first_matters : float
        The gap that matters at the first look.
    is_doubled : bool
        Whether it has doubled since, and the detector does not tell it as a fault.
    called : tuple of Called
    past : tuple of Ended
    looks : tuple of KeptLook
        The oldest first.
    begins_ns : int or None
        Where the next span to look at begins; None where nothing was recorded yet.
    refused : str
        Why the last span could not be looked at; empty where it could.
    refusals : int
        How often in a row: the next span is longer by as many days.
    """

    version: Literal["wetwell.gap-watch-state/1"] = "wetwell.gap-watch-state/1"
    station: Station
    looked_ns: int | None = None
    reference: dict[str, KeptShift] = {}
    first_matters: Short = 0.0
    is_doubled: bool = False
    called: tuple[Called, ...] = ()
    past: tuple[Ended, ...] = ()
    looks: tuple[KeptLook, ...] = ()
    begins_ns: int | None = None
    refused: str = ""
    refusals: int = 0

    def believed(self, without: Sequence[Called] = (), *, only_faults: bool = False) -> Station:
        """The station with what is called added to it: all but some, or only what is told as a fault."""
        tables = [
            one.table
            for one in self.called
            if one.table is not None and one not in without and (one.fault is not None or not only_faults)
        ]
        return self.station.model_copy(update={"effect": (*self.station.effect, *tables)})
