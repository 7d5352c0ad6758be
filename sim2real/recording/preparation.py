"""Preparation of field data before anything is learnt from it: units, offsets, doubles, order, gaps."""

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from wetwell.protocols.messages.message import Stamp
from wetwell.protocols.recordings.kpi import longest_step_s
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.table import Finite, Positive, Table
from wetwell.protocols.timestamps import NS_PER_S


class Offset(Table):
    """A constant added to a column between two times, such as after a level sensor was hung anew.

    Parameters
    ----------
    column : str
        Column of the recording.
    value : float
        What is added, in the unit of the column.
    start, end : stamp
        First and last time of the rows that it is added to.
    """

    column: str
    value: Finite
    start: Stamp
    end: Stamp

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.end <= self.start:
            raise ValueError("end must lie after start")
        return self


class Scale(Table):
    """A factor on a column, for a conversion of units.

    Parameters
    ----------
    column : str
        Column of the recording.
    factor : float
        3.6 makes m³/h of L/s. [1]
    """

    column: str
    factor: Annotated[float, Field(allow_inf_nan=False)]


class Preparation(Table):
    """What is done to a recording, in this order: scale, offset, sort by time, drop doubles, look for gaps.

    Parameters
    ----------
    scale : list of Scale
        Conversions of units.
    offset : list of Offset
        Corrections of what was measured.
    max_gap_s : float, optional
        A longer pause between rows is a gap; default: three usual steps of the recording, at least 10 s. [s]
    """

    scale: tuple[Scale, ...] = ()
    offset: tuple[Offset, ...] = ()
    max_gap_s: Positive | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """A pause between two rows: its beginning in ns since 1970, its length in s."""

    start_ns: int
    length_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PreparationReport:
    """What a preparation has found and done.

    Attributes
    ----------
    rows : int
        Rows that are left.
    shifted : dict
        Rows changed by the offsets of each column.
    out_of_order, doubled : int
        Rows that stood before an earlier one; rows dropped as their time was there already.
    max_gap_s : float
        Longest pause that is none of the gaps. [s]
    gaps : tuple of Gap
        Pauses longer than that.
    """

    rows: int
    shifted: dict[str, int]
    out_of_order: int
    doubled: int
    max_gap_s: float
    gaps: tuple[Gap, ...]


def prepare(recording: Recording, preparation: Preparation) -> tuple[Recording, PreparationReport]:
    """Prepared recording, and what was done.

    Parameters
    ----------
    recording : Recording
        As it came; it is not changed.
    preparation : Preparation

    Raises
    ------
    ValueError
        If a column is named that the recording does not have.
    """
    columns = dict(recording.columns)
    for name in [scale.column for scale in preparation.scale] + [offset.column for offset in preparation.offset]:
        if name not in columns:
            raise ValueError(f"column '{name}' is not in the recording, there are {', '.join(sorted(columns))}")
    for scale in preparation.scale:
        columns[scale.column] = columns[scale.column] * scale.factor
    shifted: dict[str, int] = {}
    for offset in preparation.offset:
        inside = (recording.time_ns >= offset.start) & (recording.time_ns <= offset.end)
        columns[offset.column] = np.where(inside, columns[offset.column] + offset.value, columns[offset.column])
        shifted[offset.column] = shifted.get(offset.column, 0) + int(inside.sum())
    order = np.argsort(recording.time_ns, kind="stable")
    time_ns = recording.time_ns[order]
    is_first = np.concatenate([[True], np.diff(time_ns) > 0]) if time_ns.size else np.zeros(0, dtype=bool)
    kept = order[is_first]
    steps_s = np.diff(recording.time_ns[kept]) / NS_PER_S
    max_gap_s = preparation.max_gap_s or longest_step_s(recording.time_ns[kept])
    report = PreparationReport(
        rows=kept.size,
        shifted=shifted,
        out_of_order=int(np.sum(np.diff(recording.time_ns) < 0)),
        doubled=int(order.size - kept.size),
        max_gap_s=max_gap_s,
        gaps=tuple(
            Gap(start_ns=int(recording.time_ns[kept[row]]), length_s=float(steps_s[row]))
            for row in np.flatnonzero(steps_s > max_gap_s)
        ),
    )
    if kept.size == order.size and report.out_of_order == 0:  # as it came: nothing is copied
        return replace(recording, columns=columns), report
    prepared = replace(
        recording,
        time_ns=recording.time_ns[kept],
        columns={name: values[kept] for name, values in columns.items()},
        truth={name: values[kept] for name, values in recording.truth.items()},
    )
    return prepared, report
