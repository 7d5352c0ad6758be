"""A correction in words: its equation with units, and one sentence that says what to look for."""

import math

import numpy as np

from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.sim2real.correction.target import EFFECT_OF_A_CONSTANT
from wetwell.simulator.corrections.acting import DAY_S
from wetwell.simulator.corrections.parts import SHAPES, Covariate, Term, shape_at
from wetwell.simulator.effects.station.correction_part import PartTable
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection

TERMS_IN_WORDS: dict[Term, str] = {
    "head_loss": "the head loss of the main",
    "static_head": "the static head",
    "inertia": "the inertia of the water in the main",
    "pump_head": "the head of the pump",
    "speed": "the speed of the pump",
    "flow_reading": "the reading of the flow meter",
    "head_reading": "the reading of the head sensor",
    "power": "the power",
    "back_flow": "the flow, at 1 m of head, back through the check valve of the pump",
    "level_balance": "the flow into the wet well",
    "level_reading": "the reading of the level sensor",
    "sump_area": "the area of the wet well",
}
UNITS_OF_TERMS: dict[Term, str] = {
    "static_head": "m",
    "inertia": "s²/m²",
    "head_reading": "m",
    "back_flow": "m³/h",
    "level_balance": "m³/h",
    "level_reading": "m",
}
"""Units of terms that a correction is added to; all others it multiplies."""
COVARIATES_IN_WORDS: dict[Covariate, tuple[str, str, str]] = {
    "level_m": ("the level", "m", "what the level covers or opens: air drawn in, a bench, a siphon"),
    "flow_m3h": ("the flow", "m³/h", "a curve of another shape, of the pump or of a meter"),
    "speed_ratio": ("the speed over the nominal one", "", "what the affinity laws leave out, or a drive that slips"),
    "since_start_s": ("the time since the start", "s", "what takes time in a run: a siphon, a valve, air, a motor"),
    "idle_before_s": ("the idle time before", "s", "what gathers or settles while the pumps stand"),
    "hour_of_day": ("the hour of the day", "h", "what follows the day: temperature, grease, voltage, a neighbour"),
    "day_of_week": ("the day of the week", "d", "what follows the week: a neighbour's working days"),
    "days": ("the time", "d", "what creeps, or comes and goes: fouling, a drift, a tide"),
    "pumps_on_main": ("the pumps on the main", "", "what the pumps share: a header, a bay they draw from"),
    "column": ("the column", "", "how it gets there"),
}
"""Covariates, their units, and what to look for where a term goes with them."""
READINGS: tuple[Term, ...] = ("flow_reading", "head_reading", "power", "level_reading")
HINT_OF_A_LATE_READING = "a meter that is late, or takes time to follow"
HINT_OF_A_CHANGE = "what was done or broke then; the times before and after it may be diagnosed apart"
_FORMS = {
    "linear": "({x} − {centre}) / {scale}",
    "square": "(({x} − {centre}) / {scale})²",
    "cosine": "cos 2π({x} − {centre}) / {scale}",
    "decay": "exp(−{x} / {scale})",
    "logarithm": "ln(1 + {x} / {scale})",
    "step": "[{x} ≥ {centre}]",
}


def name_of(part: PartTable) -> str:
    """What an addend goes by; of a user's column its name."""
    return part.column or part.covariate


def amount(value: float, term: Term, reference: float, *, signed: bool = True) -> str:
    """A size in the unit of its term, or in percent.

    Examples
    --------
    >>> amount(0.12, "head_loss", 1.0), amount(-0.1, "static_head", 26.0, signed=False)
    ('+12 %', '-2.6 m')
    """
    sign = "+" if signed else ""
    unit = UNITS_OF_TERMS.get(term)
    return f"{100.0 * value:{sign}.3g} %" if unit is None else f"{reference * value:{sign}.3g} {unit}"


def equation(effect: LearntCorrection, reference: float) -> str:
    """Equation of a correction.

    Parameters
    ----------
    effect : LearntCorrection
    reference : float
        Of its term, as `LearntCorrection.reference`.

    Examples
    --------
    >>> part = {"covariate": "hour_of_day", "shape": "cosine", "size": 0.12, "centre": 5.0, "scale": 24.0}
    >>> equation(LearntCorrection.model_validate({"term": "head_loss", "offset": 0.05, "part": [part]}), 1.0)
    'head_loss × (1 + 0.05 + 0.12 · cos 2π(hour_of_day − 5 h) / 24 h)'
    """
    unit = UNITS_OF_TERMS.get(effect.term)
    scale = 1.0 if unit is None else reference
    of_unit = "" if unit is None else f" {unit}"
    addends = [f"{_signed(scale * effect.offset)}{of_unit}"] if effect.offset else []
    addends += [f"{_signed(scale * part.size)}{of_unit} · {_form(part)}" for part in effect.part]
    whole = " ".join(addends)
    what = f"{effect.term}{_place(effect)}"
    return f"{what} × (1 {whole})" if unit is None else f"{what} {whole}"


def _place(effect: LearntCorrection) -> str:
    """Which pump or main a correction is of, empty for all."""
    return f" of pump {effect.pump}" if effect.pump else f" of main {effect.main}" if effect.main else ""


def _signed(value: float) -> str:
    return f"{'−' if value < 0.0 else '+'} {abs(value):.3g}"


def _form(part: PartTable) -> str:
    unit = COVARIATES_IN_WORDS[part.covariate][1]
    of_unit = f" {unit}" if unit else ""
    centre = f"{part.centre:.8g}" if part.covariate == "days" else f"{part.centre:.3g}"
    form = _FORMS[part.shape]
    return form.format(x=name_of(part), centre=f"{centre}{of_unit}", scale=f"{part.scale:.3g}{of_unit}")


def sentence(effect: LearntCorrection, reference: float) -> str:
    """What a correction says, its largest addend first, and what to look for.

    Examples
    --------
    >>> print(sentence(LearntCorrection.model_validate({"term": "flow_reading", "offset": 0.04}), 1.0)[-66:])
    than in the station file; the library has that as flow_meter_gain.
    >>> print(sentence(LearntCorrection.model_validate({"term": "speed", "pump": 2, "offset": -0.04}), 1.0)[:44])
    The speed of pump 2 is off by -4 %, whatever
    >>> part = {"covariate": "hour_of_day", "shape": "cosine", "size": 0.12, "centre": 5.0, "scale": 24.0}
    >>> print(sentence(LearntCorrection.model_validate({"term": "head_loss", "part": [part]}), 1.0)[:82])
    The head loss of the main swings by ±12 % with the hour of the day, highest at 05:
    """
    what, place = TERMS_IN_WORDS[effect.term], _place(effect)
    if place:
        what = what.removesuffix(" of the pump").removesuffix(" of the main") + place
    if not effect.part:
        said = f"{what} is off by {amount(effect.offset, effect.term, reference)}, whatever happens"
        known = EFFECT_OF_A_CONSTANT.get(effect.term)
        named = f"; the library has that as {known}" if known else ""
        return f"{said[0].upper()}{said[1:]}: look for what is otherwise than in the station file{named}."
    parts = sorted(effect.part, key=lambda part: -float(np.ptp(part.bounds)))
    said = f"{what} {', and '.join(_said(part, effect.term, reference) for part in parts)}"
    return f"{said[0].upper()}{said[1:]}: look for {_hint(parts[0], effect.term)}."


def _hint(part: PartTable, term: Term) -> str:
    if _is_change(part):
        return HINT_OF_A_CHANGE
    if part.covariate == "since_start_s" and term in READINGS:
        return HINT_OF_A_LATE_READING
    return COVARIATES_IN_WORDS[part.covariate][2]


def _is_change(part: PartTable) -> bool:
    """Whether something is otherwise from a time of the calendar on."""
    return part.covariate == "days" and part.shape == "step"


def _said(part: PartTable, term: Term, reference: float) -> str:
    words, unit, _ = COVARIATES_IN_WORDS[part.covariate]
    if part.column:
        errors = f", its own errors of ±{part.noise:.2g} taken off," if part.noise else ""
        words = f"the column {part.column}{errors}"
    of_unit = f" {unit}" if unit else ""
    if part.shape == "cosine":
        size = amount(abs(part.size), term, reference, signed=False)
        return f"swings by ±{size} with {words}, {_highest(part)}"
    low, high = part.known
    ends = [
        part.size * shape_at(SHAPES.index(part.shape), x, part.centre, part.scale, low, high) for x in (low, high)
    ]
    change = amount(ends[1] - ends[0], term, reference)
    if _is_change(part):
        return f"changes by {change} at {_time(part.centre)} for good"
    if part.shape == "step":
        return f"changes by {change} from {part.centre:.3g}{of_unit} of {words} on"
    return f"changes by {change} as {words} goes from {low:.4g} to {high:.4g}{of_unit}"


def _highest(part: PartTable) -> str:
    """Where a swing is highest, as people say it."""
    highest = part.centre if part.size > 0.0 else part.centre + 0.5 * part.scale
    if part.covariate == "hour_of_day":
        minutes = round(60.0 * (highest % part.scale))
        again = "" if part.scale == 24.0 else f" and each {part.scale:g} h"
        return f"highest at {minutes // 60 % 24:02}:{minutes % 60:02} UTC{again}"
    if part.covariate == "days":
        return f"each {24.0 * part.scale:.3g} h, highest at {_time(highest)} first"
    unit = COVARIATES_IN_WORDS[part.covariate][1]
    return f"highest at {highest:.3g} {unit}".rstrip()


def _time(days: float) -> str:
    """A time of the calendar, to the second, from days since 1970."""
    return to_iso(math.floor(days * DAY_S) * NS_PER_S)
