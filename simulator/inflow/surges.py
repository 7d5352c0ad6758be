"""Surges: rain and pumped inlets as a Poisson train of rectangular pulses."""

from typing import Annotated

import numpy as np
from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import NonNegative, Table


class Surges(Table):
    r"""Pulses of one height and length that arrive as a Poisson process and add up.

    $$Q(t) = \sum_i Q_\text{peak}\, \mathbb{1}_{[t_i,\, t_i + \tau)}(t)$$

    Parameters
    ----------
    rate_per_s : float
        Arrivals a second. [1/s]
    flow_m3h : float
        Height of a pulse. [m³/h]
    duration_s : int
        Length τ of a pulse. [s]

    References
    ----------
    .. [1] Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       stochastic peak model (λ = 0.0005 1/s, τ = 900 s).
    """

    rate_per_s: NonNegative = 5.0e-4
    flow_m3h: NonNegative = 30.0
    duration_s: Annotated[int, Field(gt=0)] = 900

    def stream(self, rng: np.random.Generator) -> "SurgeStream":
        """Stream of this train, drawn from a generator of its own."""
        return SurgeStream(self, rng)


class SurgeStream:
    """A running train of surges; remembers the arrivals of the last pulse length."""

    def __init__(self, surges: Surges, rng: np.random.Generator) -> None:
        self._surges = surges
        self._rng = rng
        self._recent = np.zeros(surges.duration_s, dtype=np.int64)

    def next_seconds(self, seconds: int) -> Floats:
        """(seconds,) flow of the surges of the next seconds, in m³/h."""
        arrivals = np.concatenate([self._recent, self._rng.poisson(self._surges.rate_per_s, seconds)])
        arrived = np.concatenate([[0], np.cumsum(arrivals)])
        duration = self._surges.duration_s
        active: Floats = (arrived[duration + 1 :] - arrived[1:-duration]).astype(np.float64)
        self._recent = arrivals[-duration:]
        return self._surges.flow_m3h * active
