"""The dictionary of which a correction is made: shapes of covariates, each over the range in which it was seen."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.correction.bin_covariates import Place
from wetwell.sim2real.likelihood.posterior import FURTHER_PRIOR
from wetwell.simulator.corrections.parts import SHAPES, Shape, shapes_at
from wetwell.simulator.effects.station.correction_part import MOST_SIZE, PartTable

KNOWN_RANGE = (0.01, 0.99)
"""Quantiles of a covariate between which its shapes are known."""
DECAYS_S = (10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
"""Time constants that are tried."""
STEPS_S = (15.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0, 180.0, 300.0)
"""Times in a run from which something may be otherwise: a pipe runs full, a valve is open."""
LOGARITHM_S = 60.0
"""Time after which a logarithm of a time begins to bend. [s]"""
PERIOD_RATIO = 1.15
FINER_PERIODS = 15
LONGEST_PERIOD, SHORTEST_PERIOD = 2.0, 0.125
"""Ratio of periods of days that are tried one after the other, and how many around the best are tried then; the
longest and the shortest over the length of the recording."""
TIMES_OF_CHANGE = 15
"""Times of a recording, evenly over it, from which something may be otherwise, and how many around the best are tried
then."""
LEAST_CYCLES = 6
"""Distinct values of a covariate at the least."""
HOURS, WEEK_D = (24.0, 12.0), 7.0
"""Periods of the hour of the day [h] and of a week [d]."""
MOST_OF_WEEK = 0.8
"""Share of a week that a recording has to have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Atom:
    """A shape of a covariate; `columns` (bins, 1), or (bins, 2) with cosine and sine of a swing.

    Attributes
    ----------
    place : Place
    shape : Shape
    centre, scale, low, high : float
        In the unit of the covariate.
    columns : array
        Dimensionless.
    log_prior : float
        Logarithm of the probability that it acts: one more addend is as usual as one more effect, and it is one of
        its dictionary.
    """

    place: Place
    shape: Shape
    centre: float
    scale: float
    low: float
    high: float
    columns: Floats
    log_prior: float = 0.0

    def part(self, sizes: Floats) -> PartTable:
        """Addend with sizes of the columns; of a swing its amplitude, and where it is highest."""
        size, centre = float(sizes[0]), self.centre
        if self.shape == "cosine":
            size = float(np.hypot(*sizes))
            centre = float(np.arctan2(sizes[1], sizes[0]) / (2.0 * np.pi) * self.scale) % self.scale
            if self.place.covariate == "days":  # the first time at which it is highest
                centre += np.ceil((self.low - centre) / self.scale) * self.scale
        known = {} if self.shape == "cosine" else {"low": _short(self.low), "high": _short(self.high)}
        return PartTable(
            covariate=self.place.covariate,
            column=self.place.column,
            noise=_short(self.place.noise),
            shape=self.shape,
            size=float(np.clip(_short(size), -MOST_SIZE, MOST_SIZE)),
            centre=_short(centre),
            scale=_short(self.scale),
            **known,
        )


def _short(value: float) -> float:
    """A number of nine digits: days since 1970 need them."""
    return float(f"{value:.9g}")


def dictionary(covariates: Mapping[Place, Floats], is_running: Floats) -> tuple[tuple[Atom, ...], dict[str, str]]:
    """Atoms of all covariates that vary, and why the others have none.

    Parameters
    ----------
    covariates : mapping of (bins,) arrays
    is_running : (bins,) array
        Bins by which ranges are found.
    """
    atoms: list[Atom] = []
    left_out: dict[str, str] = {}
    columns = {place: values for place, values in covariates.items() if place.column is not None}
    for place, values in covariates.items():
        known = values[is_running & np.isfinite(values)]
        if place.column is not None and (why := _useless(place, known, covariates, columns)):
            left_out[place.column] = why
            continue
        if known.size and np.unique(known).size >= (2 if place.covariate == "pumps_on_main" else LEAST_CYCLES):
            atoms += _atoms(place, values, known)
    places = [atom.place[:2] for atom in atoms]
    shares = [FURTHER_PRIOR / len(set(places)) / places.count(place) for place in places]
    found = [replace(atom, log_prior=float(np.log(share))) for atom, share in zip(atoms, shares, strict=True)]
    return tuple(found), left_out


def _useless(
    place: Place, known: Floats, covariates: Mapping[Place, Floats], columns: Mapping[Place, Floats]
) -> str | None:
    """Why a column of a user says nothing, None where it may."""
    if known.size == 0:
        return "has no values while a pump runs"
    if np.ptp(known) == 0.0:
        return f"is constant ({known[0]:g})"
    for other, values in covariates.items():
        if other[:2] == place[:2]:
            break
        both = np.isfinite(values) & np.isfinite(columns[place])
        if both.any() and np.ptp(values[both]) > 0.0 and np.ptp(columns[place][both]) > 0.0:
            alike = np.corrcoef(values[both], columns[place][both])[0, 1]
            if abs(alike) > ALIKE:
                return f"is a copy of {other.column or other.covariate} (correlation {alike:.4f})"
    return None


ALIKE = 0.9995
"""Correlation from which a column is another one's copy: what parts them is less than a 30th of its spread. [1]"""


def _atoms(place: Place, values: Floats, known: Floats) -> list[Atom]:
    low, high = (float(value) for value in np.quantile(known, KNOWN_RANGE))
    if low >= high:
        low, high = float(known.min()), float(known.max())
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def made(shape: Shape, centre: float, scale: float) -> Atom:
        return _made(place, values, shape, centre, scale, (low, high))

    found: list[Atom] = []
    match place.covariate:
        case "hour_of_day":
            found = [made("cosine", 0.0, period_h) for period_h in HOURS if high - low > 0.5 * period_h]
        case "day_of_week":
            found = [made("cosine", 0.0, WEEK_D)] if np.ptp(known) > MOST_OF_WEEK * WEEK_D else []
        case "days":
            count = int(np.log(LONGEST_PERIOD / SHORTEST_PERIOD) / np.log(PERIOD_RATIO))
            periods = [LONGEST_PERIOD * (high - low) / PERIOD_RATIO**k for k in range(count + 1)]
            times = np.linspace(low, high, TIMES_OF_CHANGE + 2)[1:-1]
            found = [made("linear", middle, half), *(made("cosine", 0.0, period) for period in periods)]
            found += [made("step", float(time), 1.0) for time in times]
        case "since_start_s":
            found = [made("decay", 0.0, scale_s) for scale_s in DECAYS_S if scale_s < high]
            found += [made("step", step_s, 1.0) for step_s in STEPS_S if low < step_s < high]
            found += [made("logarithm", 0.0, LOGARITHM_S)]
        case "idle_before_s":
            found = [made("decay", 0.0, scale_s) for scale_s in DECAYS_S if 0.3 * low < scale_s < high]
            found += [made("logarithm", 0.0, LOGARITHM_S), made("linear", middle, half)]
        case "pumps_on_main":
            found = [made("step", 1.5, 1.0)]
        case _:
            found = [made("linear", middle, half)]
            found += [made("square", end, 2.0 * half) for end in (high, low)]
    return found


def _made(
    place: Place, values: Floats, shape: Shape, centre: float, scale: float, known: tuple[float, float]
) -> Atom:
    columns = shapes_of(values, shape, centre, scale, *known)[:, None]
    if shape == "cosine":
        columns = np.column_stack([columns, shapes_of(values, shape, centre + 0.25 * scale, scale, *known)])
    low, high = known
    return Atom(place=place, shape=shape, centre=centre, scale=scale, low=low, high=high, columns=columns)


def near(atom: Atom, values: Floats, width: float) -> list[Atom]:
    """A swing or a step over the days, with periods or times around its own; any other atom as it is.

    Parameters
    ----------
    atom : Atom
    values : (bins,) array
        Of its covariate.
    width : float
        How far around, over the way to the next one of the dictionary. [1]
    """
    finer = width * np.linspace(-1.0, 1.0, FINER_PERIODS if atom.shape == "cosine" else TIMES_OF_CHANGE)
    known = (atom.low, atom.high)
    match atom.place.covariate, atom.shape:
        case "days", "cosine":
            scales = atom.scale * PERIOD_RATIO**finer
            found = [_made(atom.place, values, "cosine", 0.0, float(scale), known) for scale in scales]
        case "days", "step":
            times = atom.centre + finer * (atom.high - atom.low) / (TIMES_OF_CHANGE + 1)
            found = [_made(atom.place, values, "step", float(time), 1.0, known) for time in times]
        case _:
            return [atom]
    return [replace(one, log_prior=atom.log_prior) for one in found]


def shapes_of(values: Floats, shape: Shape, centre: float, scale: float, low: float, high: float) -> Floats:
    """(n,) dimensionless values of a shape, those of the simulator."""
    found = np.empty(values.size)
    shapes_at(SHAPES.index(shape), values, centre, scale, low, high, found)
    return found
