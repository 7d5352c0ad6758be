"""Which act is worth doing: what each tells, what it costs, and which sets it tells apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.costs import Costs
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.attribution.possible import PossibleSet
from wetwell.sim2real.attribution.trials import Each
from wetwell.sim2real.experiments.act import Act, Site, site_of
from wetwell.sim2real.experiments.acts import acts_of
from wetwell.sim2real.experiments.conditions import Conditions
from wetwell.sim2real.experiments.information import evidences, information_bits, resolved_probability, told
from wetwell.sim2real.experiments.playing import Played, play, simulated
from wetwell.sim2real.likelihood.posterior import CREDIBLE

LEAST_BITS = 0.01
"""Information under which an act tells nothing: a hundredth of a question that is answered by yes or no. [bit]"""
RESOLVING = 0.9
"""Probability of leaving nothing open from which the cheapest act is taken. [1]"""
USUAL_S, USUAL_ROWS = 7200, 200
"""Least time, and least rows, of what an act is compared with. [s, 1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """An act with what it is expected to bring and to cost, the mean over the sets that are left.

    Attributes
    ----------
    act : Act
    information_bits : float
        What it is expected to tell of the truth, where the model is as good as it seems. [bit]
    truth_probability : float
        Expected probability of the true set afterwards, though the model is poor.
    resolved_probability : float
        Probability that the true set has `CREDIBLE` afterwards, though the model is poor.
    separates : tuple of tuple of str
        Sets that it tells from one another or from the rest, the most probable first.
    moved_m3, extra_kwh, crew_h, length_h : float
        Water, energy beyond that of the controller, work and time. [m³, kWh, h, h]
    price : float
        Of energy and work, in the currency of the station's costs.
    """

    act: Act
    information_bits: float
    truth_probability: float
    resolved_probability: float
    separates: tuple[tuple[str, ...], ...]
    moved_m3: float
    extra_kwh: float
    crew_h: float
    length_h: float
    price: float

    @property
    def resolves(self) -> bool:
        """Whether it most probably leaves nothing open."""
        return self.resolved_probability >= RESOLVING

    @property
    def rank(self) -> tuple[float, ...]:
        """Least of the best act: what resolves, by its price; else what tells most, to a tenth of a bit."""
        return (0.0, self.price) if self.resolves else (1.0, -round(self.information_bits, 1), self.price)


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused:
    """An act that may not be done, and why."""

    act: Act
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposals:
    """Acts, the best first, and those that are ruled out."""

    best: tuple[Proposal, ...]
    refused: tuple[Refused, ...]


def proposals_of(
    station: Station, sets: Sequence[PossibleSet], conditions: Conditions, *, seed: int = 0, each: Each = map
) -> Proposals:
    """Weigh all acts that can be done at a station.

    First come those that resolve what is left though the model is poor, the cheapest first; then the others, by what
    they tell where it is good.

    Parameters
    ----------
    station : Station
        As it was before the diagnosis.
    sets : sequence of PossibleSet
        What the diagnosis leaves.
    conditions : Conditions
    seed : int
        Of the noise in what is simulated.
    each : callable
        As `map`; acts are weighed one by one or side by side.
    """
    if len(sets) < 2 or station.control.is_external:
        return Proposals(best=(), refused=())
    singled_out = {getattr(effect, "pump", 0) for one in sets for effect in one.effects}
    site = site_of(station, singled_out)
    usual = _usual(site, station, sets, conditions, seed)
    known = np.array([evidences([one], station, sets, truth) for one, truth in zip(usual, sets, strict=True)])
    weighed = list(
        each(lambda act: _weighed(act, site, station, sets, conditions, seed, usual, known), acts_of(site))
    )
    useful = [one for one in weighed if isinstance(one, Proposal) and one.information_bits >= LEAST_BITS]
    return Proposals(
        best=tuple(sorted(useful, key=lambda one: one.rank)),
        refused=tuple(one for one in weighed if isinstance(one, Refused)),
    )


def _usual(
    site: Site, station: Station, sets: Sequence[PossibleSet], conditions: Conditions, seed: int
) -> list[Recording]:
    """What each set shows without an act: an act tells only what comes on top."""
    seconds = max(USUAL_S, round(USUAL_ROWS * conditions.rate_s))
    return [
        conditions.recorded(simulated(site, station, one, conditions, seed + 1, seconds), site.pumps) for one in sets
    ]


def _weighed(
    act: Act,
    site: Site,
    station: Station,
    sets: Sequence[PossibleSet],
    conditions: Conditions,
    seed: int,
    usual: Sequence[Recording],
    known: Floats,
) -> Proposal | Refused:
    played, logs = [], []
    for one, before in zip(sets, usual, strict=True):
        try:
            passage = play(act, site, station, one, conditions, seed)
            if passage.broken:
                return Refused(act=act, reason=passage.broken)
            during = conditions.recorded(passage.recording, site.pumps)
            logs.append(evidences([before, during], station, sets, one))
        except ValueError as error:
            return Refused(act=act, reason=str(error))
        played.append(passage)
    probability = np.array([one.probability for one in sets])
    probability /= probability.sum()
    gained = np.array(logs) - known
    good, poor = told(probability, gained[:, 0]), told(probability, gained[:, 1])
    return _proposal(act, sets, probability, good, poor, played, station.costs or Costs())


def _proposal(
    act: Act,
    sets: Sequence[PossibleSet],
    probability: Floats,
    good: Floats,
    poor: Floats,
    played: Sequence[Played],
    costs: Costs,
) -> Proposal:
    moved_m3, extra_kwh, length_h = (
        float(probability @ np.array([getattr(one, name) for one in played]))
        for name in ("moved_m3", "extra_kwh", "length_h")
    )
    crew_h = act.people * (length_h + act.travel_h)
    return Proposal(
        act=act,
        information_bits=information_bits(probability, good),
        truth_probability=float(probability @ np.diag(poor)),
        resolved_probability=resolved_probability(probability, poor),
        separates=tuple(sets[k].names for k in _separated(poor)),
        moved_m3=moved_m3,
        extra_kwh=extra_kwh,
        crew_h=crew_h,
        length_h=length_h,
        price=extra_kwh * costs.energy_per_kwh + crew_h * costs.crew_per_hour,
    )


def _separated(after: Floats) -> list[int]:
    """Sets that are told from some other, whichever of the two is the truth."""
    own = np.diag(after)
    odds = own[:, None] / np.maximum(after, 1e-300)
    is_told = odds >= CREDIBLE / (1.0 - CREDIBLE)
    return [int(k) for k in np.flatnonzero(np.any(is_told & is_told.T, axis=1))]
