"""Inflow from a recording."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, ConfigDict, PlainSerializer, WithJsonSchema, model_validator

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import Table


def _floats(values: Any) -> Floats:
    try:
        return np.asarray(values, dtype=np.float64)
    except TypeError as error:
        raise ValueError("must be an array of numbers") from error


FloatArray = Annotated[
    np.ndarray,
    BeforeValidator(_floats),
    PlainSerializer(np.ndarray.tolist, when_used="json"),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 1}),
]


class RecordedInflow(Table):
    """A measured series; each value holds until the next one, and the series repeats when it ends.

    Parameters
    ----------
    time_s : (n,) array
        Seconds since the first value, rising, starting at 0. [s]
    flow_m3h : (n,) array
        Inflow at each of these times. [m³/h]
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    kind: Literal["recorded"] = "recorded"
    time_s: FloatArray
    flow_m3h: FloatArray

    @model_validator(mode="after")
    def _check_series(self) -> Self:
        if self.time_s.ndim != 1 or self.time_s.size == 0 or self.time_s.shape != self.flow_m3h.shape:
            raise ValueError("a recorded inflow needs as many times as flows, and at least one")
        if self.time_s[0] != 0 or not np.all(np.diff(self.time_s) > 0) or not np.isfinite(self.time_s[-1]):
            raise ValueError("time_s must rise from 0 and be finite")
        if not np.all(np.isfinite(self.flow_m3h)) or np.any(self.flow_m3h < 0):
            raise ValueError("flow_m3h must be finite and not negative")
        return self

    def stream(self, rng: np.random.Generator) -> "RecordedStream":  # noqa: ARG002 - as every model
        """Stream of this inflow; nothing in it is random."""
        return RecordedStream(self)


class RecordedStream:
    """A running recorded inflow."""

    def __init__(self, inflow: RecordedInflow) -> None:
        self._inflow = inflow
        steps_s = np.diff(inflow.time_s)
        self._period_s = float(inflow.time_s[-1] + (np.median(steps_s) if steps_s.size else 1.0))
        self._time_s = 0

    def next_seconds(self, seconds: int) -> Floats:
        """(seconds,) inflow of the next seconds, in m³/h."""
        time_s = np.arange(self._time_s, self._time_s + seconds) % self._period_s
        self._time_s += seconds
        rows = np.searchsorted(self._inflow.time_s, time_s, side="right") - 1
        taken: Floats = self._inflow.flow_m3h[rows]
        return taken
