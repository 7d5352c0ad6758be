"""Inflow with a daily sine."""

from typing import Literal

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import Finite, NonNegative, Positive, Table
from wetwell.simulator.inflow.surges import Surges


class DiurnalInflow(Table):
    r"""A sine over the day with Gaussian noise, and surges on top; never negative.

    $$Q(t) = \max\Bigl(0,\ \bar Q + \hat Q \sin\frac{2 \pi t}{T} + \varepsilon(t)\Bigr)
    + \sum_i Q_\text{peak}\, \mathbb{1}_{[t_i,\, t_i + \tau)}(t), \qquad \varepsilon \sim N(0, \sigma^2)$$

    Parameters
    ----------
    mean_m3h, amplitude_m3h, noise_m3h : float
        Mean, amplitude of the sine, standard deviation of the noise. [m³/h]
    period_s : float
        Length of the sine; a day is 86,400. [s]
    surges : Surges

    References
    ----------
    .. [1] Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       pipe clogging scenario.
    """

    kind: Literal["diurnal"] = "diurnal"
    mean_m3h: NonNegative = 60.0
    amplitude_m3h: Finite = 20.0
    noise_m3h: NonNegative = 5.0
    period_s: Positive = 86400.0
    surges: Surges = Surges(flow_m3h=50.0)

    def stream(self, rng: np.random.Generator) -> "DiurnalStream":
        """Stream of this inflow."""
        return DiurnalStream(self, *rng.spawn(2))


class DiurnalStream:
    """A running diurnal inflow."""

    def __init__(self, inflow: DiurnalInflow, noise_rng: np.random.Generator, surge_rng: np.random.Generator) -> None:
        self._inflow = inflow
        self._rng = noise_rng
        self._surges = inflow.surges.stream(surge_rng)
        self._time_s = 0

    def next_seconds(self, seconds: int) -> Floats:
        """(seconds,) inflow of the next seconds, in m³/h."""
        time_s = np.arange(self._time_s, self._time_s + seconds)
        self._time_s += seconds
        base_m3h: Floats = self._inflow.mean_m3h + self._inflow.amplitude_m3h * np.sin(
            2.0 * np.pi * time_s / self._inflow.period_s
        )
        noise_m3h: Floats = self._inflow.noise_m3h * self._rng.standard_normal(seconds)
        return np.maximum(base_m3h + noise_m3h, 0.0) + self._surges.next_seconds(seconds)
