"""Inflow drawn from a measured distribution."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import NonNegative, Table
from wetwell.simulator.inflow.surges import Surges, SurgeStream

PAPER_QUANTILES = ((0.0, 0.0), (0.5, 57.6), (0.95, 115.2), (0.99, 144.0), (1.0, 180.0))


class EmpiricalInflow(Table):
    r"""Independent draws from an empirical distribution, with surges on top.

    $$Q(t) = \hat F^{-1}(u_t) + \sum_i Q_\text{peak}\, \mathbb{1}_{[t_i,\, t_i + \tau)}(t), \qquad u_t \sim U(0, 1)$$

    The distribution is given by quantiles and linear between them.

    Parameters
    ----------
    quantiles : sequence of (probability, flow_m3h)
        Rising from probability 0 to 1. The default has the median and the 95th and 99th percentile that the paper
        reports (0.016, 0.032 and 0.040 m³/s). [1, m³/h]
    surges : Surges

    References
    ----------
    .. [1] Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       ECDF inflow sampler.
    """

    kind: Literal["empirical"] = "empirical"
    quantiles: Annotated[tuple[tuple[Annotated[float, Field(ge=0, le=1)], NonNegative], ...], Field(min_length=2)] = (
        PAPER_QUANTILES
    )
    surges: Surges = Surges()

    @model_validator(mode="after")
    def _check_quantiles(self) -> Self:
        probabilities = [probability for probability, _ in self.quantiles]
        flows_m3h = [flow_m3h for _, flow_m3h in self.quantiles]
        if probabilities[0] != 0 or probabilities[-1] != 1 or np.any(np.diff(probabilities) <= 0):
            raise ValueError(f"quantiles: probabilities must rise from 0 to 1, got {probabilities}")
        if np.any(np.diff(flows_m3h) < 0):
            raise ValueError(f"quantiles: flows must not fall, got {flows_m3h}")
        return self

    def stream(self, rng: np.random.Generator) -> "EmpiricalStream":
        """Stream of this inflow."""
        return EmpiricalStream(self, *rng.spawn(2))


class EmpiricalStream:
    """A running empirical inflow."""

    def __init__(
        self, inflow: EmpiricalInflow, base_rng: np.random.Generator, surge_rng: np.random.Generator
    ) -> None:
        self._probabilities, self._flows_m3h = np.array(inflow.quantiles).T
        self._rng = base_rng
        self._surges: SurgeStream = inflow.surges.stream(surge_rng)

    def next_seconds(self, seconds: int) -> Floats:
        """(seconds,) inflow of the next seconds, in m³/h."""
        base_m3h: Floats = np.interp(self._rng.random(seconds), self._probabilities, self._flows_m3h)
        return base_m3h + self._surges.next_seconds(seconds)
