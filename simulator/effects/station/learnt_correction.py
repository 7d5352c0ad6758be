"""What a diagnosis has learnt and nobody has named yet."""

import math
from collections.abc import Collection
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from wetwell.simulator.corrections.parts import (
    ALL,
    BACK_FLOW,
    COVARIATES,
    HEAD_READING,
    INERTIA,
    LEAST_LEFT,
    LEVEL_BALANCE,
    LEVEL_READING,
    SHAPES,
    STATIC_HEAD,
    TERMS,
    CorrectionPart,
    Covariate,
    Term,
)
from wetwell.simulator.effects.effect import Component, Effect, MainNumber, PumpNumber, limits
from wetwell.simulator.effects.station.correction_part import MOST_SIZE, PartTable
from wetwell.simulator.parameters import PlantParameters

LEAST_OFFSET = -0.9
"""Of the term, at the least. [1]"""
SLOW_START_S = 10.0
"""In so long a time the rated head brings the water of the reference of the inertia to the rated flow. [s]"""
_MAY_BE_NOTHING = frozenset({STATIC_HEAD, INERTIA, BACK_FLOW, LEVEL_BALANCE, LEVEL_READING})
"""Places of terms of which a correction may leave nothing."""
_COMPONENT_OF: dict[Term, Component] = {
    "head_loss": "rising_main",
    "static_head": "rising_main",
    "inertia": "rising_main",
    "pump_head": "pump",
    "speed": "drive",
    "flow_reading": "flow_meter",
    "head_reading": "head_sensor",
    "power": "drive",
    "back_flow": "pump",
    "level_balance": "sump",
    "level_reading": "level_sensor",
    "sump_area": "sump",
}
"""Where the cause of a correction of a term lies that goes with something."""
_IN_A_RUN: tuple[Covariate, ...] = ("since_start_s", "idle_before_s")
"""What tells the seconds of a run, and one run, from others."""


def place_of(term: Term, pump: int, covariates: Collection[Covariate]) -> Component:
    """Component in which the cause of a correction lies.

    A power that is off alike in all runs of all pumps is its meter's: drives wear one by one, and what they draw goes
    with load and supply. A speed that is off in one pump alone, or comes in a run, is the pump's: a drive turns as it
    is told in each second of a run, and a worn or ragged impeller does less at the same speed.

    Parameters
    ----------
    term : str
    pump : int
        Of which pump, from 1; 0 for all.
    covariates : collection of str
        What it goes with; empty for a constant.
    """
    if term == "power" and not pump and not covariates:
        return "power_meter"
    if term == "speed" and (pump or not set(covariates).isdisjoint(_IN_A_RUN)):
        return "pump"
    return _COMPONENT_OF[term]


class LearntCorrection(Effect):
    r"""One term of the model goes with what its addends say, and no effect of the library has a name for it.

    $$X \leftarrow X + X_r\,c \quad (\text{read flow, power, losses, pump head, speed, area: } X_r = X), \qquad
    c = c_0 + \sum_k a_k\, \phi_k\!\left(\frac{x_k - x_{0k}}{s_k}\right)$$

    The reference $X_r$ is the rated head for static head and reading of the head, the rated flow for the balance
    of the level, 1 m for its reading. That of the inertia is brought to the rated flow by the rated head in
    `SLOW_START_S`. What flows back through a standing pump is counted at 1 m, and its reference is
    such that the rated flow would flow back at the rated head. Shapes φ: z, z², cos 2πz, exp(−z), ln(1 + z), and the
    step [z >= 0].

    Parameters
    ----------
    term : str
        X, the term of the model that is corrected.
    offset : float
        c_0, the same correction at all times; 0 is none. [1]
    part : sequence of tables
        At most three: `covariate` (x; `column` names one of a user, `noise` is what it errs by), `shape` (φ), `size`
        (a), `centre` (x_0), `scale` (s), and the range from `low` to `high` in which it is known.
    pump : int
        Of a term that each pump has; 0 for all.
    main : int
        Of a loss or a static head; 0 for all.

    References
    ----------
    .. [1] M. C. Kennedy, A. O'Hagan, Bayesian calibration of computer models, JRSS B 63, 2001: a discrepancy as part
       of the model.
    """

    component: ClassVar[Component] = "station"
    neutral: ClassVar[dict[str, float]] = {"offset": 0.0}
    is_learnt: ClassVar[bool] = True

    name: Literal["learnt_correction"] = "learnt_correction"
    term: Term
    offset: Annotated[float, limits(LEAST_OFFSET, MOST_SIZE, "1")] = 0.0
    part: Annotated[tuple[PartTable, ...], Field(max_length=3)] = ()
    pump: PumpNumber = 0
    main: MainNumber = 0

    @property
    def place(self) -> Component:
        """Component in which the cause lies."""
        return place_of(self.term, self.pump, [part.covariate for part in self.part])

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest c, as if all addends could be so at once."""
        lows, highs = zip(*(part.bounds for part in self.part), strict=True) if self.part else ((), ())
        return self.offset + sum(lows), self.offset + sum(highs)

    def reference(self, parameters: PlantParameters) -> float:
        """X_r in the unit of the term; 1 where c is a share of the term itself. [m, s²/m², m³/h, 1]."""
        term = TERMS.index(self.term)
        flow_m3h, head_m = float(np.max(parameters.rated_flow_m3h)), float(np.max(parameters.rated_head_m))
        inertia_s2_m2 = SLOW_START_S * float(np.max(parameters.rated_inertia_s2_m2))
        of_term = {STATIC_HEAD: head_m, INERTIA: inertia_s2_m2, HEAD_READING: head_m, LEVEL_BALANCE: flow_m3h}
        return of_term.get(term, flow_m3h / math.sqrt(head_m) if term == BACK_FLOW else 1.0)

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Add the addends.

        Raises
        ------
        ValueError
            If they would leave nothing of a flow or a head, or name a pump or a main that the term does not have.
        """
        term = TERMS.index(self.term)
        of_station, of_pipe = term >= LEVEL_BALANCE, term <= INERTIA
        for key, number, fits in (("pump", self.pump, not (of_station or of_pipe)), ("main", self.main, of_pipe)):
            if number and not fits:
                raise ValueError(f"learnt_correction.{key}: got {number}, term '{self.term}' has no {key} of its own")
        low, high = self.bounds
        if term not in _MAY_BE_NOTHING and 1.0 + low < LEAST_LEFT:
            raise ValueError(
                f"learnt_correction: {self.term} would fall to {1.0 + low:.3g} of itself, must keep {LEAST_LEFT:g}"
            )
        size = self.reference(parameters)
        if term == STATIC_HEAD:
            _check_lift(parameters, high * size)
        columns = list(parameters.columns)
        columns += dict.fromkeys(part.source for part in self.part if part.source and part.source not in columns)
        place = {"pump": self.pump - 1 if self.pump else ALL, "main": self.main - 1 if self.main else ALL}
        added = [CorrectionPart(term=term, size=size * self.offset, **place)] if self.offset else []
        for part in self.part:
            known_low, known_high = part.known
            added.append(
                CorrectionPart(
                    term=term,
                    covariate=COVARIATES.index(part.covariate),
                    shape=SHAPES.index(part.shape),
                    column=columns.index(part.source) if part.source else 0,
                    size=size * part.size,
                    centre=part.centre,
                    scale=part.scale,
                    low=known_low,
                    high=known_high,
                    **place,
                )
            )
        return replace(parameters, corrections=(*parameters.corrections, *added), columns=tuple(columns))


def _check_lift(parameters: PlantParameters, rise_m: float) -> None:
    """Refuse a static head that no pump lifts."""
    for number, pump in enumerate(parameters.pumps, start=1):
        lift_m = parameters.mains[pump.main].static_head_at_m(parameters.rated_level_m) + rise_m
        if pump.is_automatic and pump.c0 <= lift_m:
            raise ValueError(
                f"learnt_correction: static_head would rise to {lift_m:.3g} m, pump {number} lifts {pump.c0:.3g} m: "
                "no water would flow"
            )
