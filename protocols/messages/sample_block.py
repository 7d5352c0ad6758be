"""Many samples of one station in one message, column by column: for many stations, and for slow lines."""

from collections.abc import Sequence
from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.messages import Message, Number, PumpReading, Quality, Sample, Stamp

T = TypeVar("T")

MOST_SAMPLES = 600
"""In one message: ten minutes at one a second."""

Seq = Annotated[int, Field(ge=0, lt=2**63)]
Numbers = tuple[Number, ...]
"""Values of one quantity, one a sample; empty where none has one."""


class PumpBlock(Message):
    """What is measured at one pump."""

    frequency_hz: Numbers = ()
    flow_m3h: Numbers = ()
    head_m: Numbers = ()
    power_kw: Numbers = ()
    running: tuple[bool | None, ...] = ()


class SampleBlock(Message):
    """What is measured at one station at several times, oldest first, all of one quality.

    Says the same as so many `Sample`, in a tenth of the messages and half of the bytes.
    """

    schema_name: Literal["wetwell.samples/1"] = Field("wetwell.samples/1", alias="schema")
    station: str
    seq: tuple[Seq, ...] = Field(min_length=1, max_length=MOST_SAMPLES)
    time: tuple[Stamp, ...]
    level_m: Numbers = ()
    inflow_m3h: Numbers = ()
    pumps: tuple[PumpBlock, ...]
    quality: Quality = "good"

    @model_validator(mode="after")
    def _columns_are_as_long(self) -> Self:
        samples = len(self.seq)
        if len(self.time) != samples:
            raise ValueError(f"time: {len(self.time)} values, must be {samples} as in seq")
        for place, column in enumerate(_columns(self)):
            if len(column) not in {0, samples}:
                raise ValueError(f"{_name(place)}: {len(column)} values, must be {samples} as in seq, or none")
        return self

    @classmethod
    def of(cls, samples: Sequence[Sample]) -> Self:
        """Block of at least one sample of the same station, quality and number of pumps."""
        pumps = zip(*(sample.pumps for sample in samples), strict=True)
        return cls(
            station=samples[0].station,
            seq=tuple(sample.seq for sample in samples),
            time=tuple(sample.time for sample in samples),
            level_m=_column([sample.level_m for sample in samples]),
            inflow_m3h=_column([sample.inflow_m3h for sample in samples]),
            pumps=tuple(
                PumpBlock(
                    frequency_hz=_column([reading.frequency_hz for reading in readings]),
                    flow_m3h=_column([reading.flow_m3h for reading in readings]),
                    head_m=_column([reading.head_m for reading in readings]),
                    power_kw=_column([reading.power_kw for reading in readings]),
                    running=_column([reading.running for reading in readings]),
                )
                for readings in pumps
            ),
            quality=samples[0].quality,
        )

    def samples(self) -> list[Sample]:
        """The samples one by one."""
        columns = [column or (None,) * len(self.seq) for column in _columns(self)]
        return [
            Sample.model_construct(
                station=self.station,
                seq=seq,
                time=time,
                level_m=level_m,
                inflow_m3h=inflow_m3h,
                pumps=tuple(
                    PumpReading.model_construct(
                        frequency_hz=values[at],
                        flow_m3h=values[at + 1],
                        head_m=values[at + 2],
                        power_kw=values[at + 3],
                        running=values[at + 4],
                    )
                    for at in range(0, len(values), 5)
                ),
                quality=self.quality,
            )
            for seq, time, level_m, inflow_m3h, *values in zip(self.seq, self.time, *columns, strict=True)
        ]

    def values(self, pumps: int | None = None) -> Floats:
        """(n, 2 + 5 pumps) level, inflow, then frequency, flow, head, power and running of each pump; NaN: no value.

        Parameters
        ----------
        pumps : int, optional
            Number of pumps to have columns for; that of the block if not given.
        """
        columns = _columns(self)
        width = len(columns) if pumps is None else 2 + 5 * pumps
        values = np.full((len(self.seq), width), np.nan)
        for place, column in enumerate(columns[:width]):
            if column:
                values[:, place] = column
        return values


def _columns(block: SampleBlock) -> list[tuple[float | bool | None, ...]]:
    columns: list[tuple[float | bool | None, ...]] = [block.level_m, block.inflow_m3h]
    for pump in block.pumps:
        columns += (pump.frequency_hz, pump.flow_m3h, pump.head_m, pump.power_kw, pump.running)
    return columns


def _name(place: int) -> str:
    """Name of a column, as in a recording."""
    if place < 2:
        return ("level_m", "inflow_m3h")[place]
    pump, quantity = divmod(place - 2, 5)
    return f"pump{pump + 1}_{list(PumpBlock.model_fields)[quantity]}"


def _column(values: Sequence[T | None]) -> tuple[T | None, ...]:
    return () if all(value is None for value in values) else tuple(values)
