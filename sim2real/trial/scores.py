"""Scores of a trial: answers beside opened labels."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from wetwell.protocols.arrays import Integers
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.sim2real.trial.answer import Answer, ToldEffect
from wetwell.sim2real.trial.cases import KNOWN_KINDS, VERDICT_OF, CaseKind
from wetwell.sim2real.trial.exact import has_all, is_exact_set
from wetwell.sim2real.trial.families import PlantName

FAILED = "failed"
NOT_TESTED = "not tested"
"""Column of what a report lists as an effect that its recording cannot show."""
TELLS = ("effect", "none", "unknown", FAILED)
PERMUTATIONS = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """What a sealed case is.

    Attributes
    ----------
    case, kind, plant : str
        Of a `TrialCase`.
    names, components : tuple of str
        True effects and where they lie.
    parameters : mapping of effect to mapping of parameter to value
        Some are the library's, by name and unit.
    inherent : tuple of str
        Effects that this plant always has to some degree: to tell them is neither right nor wrong.
    attempt : int
        Which draw of the case is published, from 0.
    every_s, value, absent
        How its recording is stored, as of a `Storage`.
    slow_share : float
        Share of the sensors' variance that is slow. [1]
    """

    case: str
    kind: CaseKind
    plant: PlantName
    names: tuple[str, ...]
    components: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, Any]]
    inherent: tuple[str, ...] = ()
    attempt: int = 0
    every_s: int = 1
    value: StoredValue = "instant"
    absent: tuple[str, ...] = ()
    slow_share: float = 0.0

    @property
    def rate(self) -> str:
        """How often what is stored."""
        return f"{self.every_s} s {self.value}"

    @property
    def metering(self) -> str:
        """Whether the inflow is measured."""
        return "without inflow" if "inflow_m3h" in self.absent else "with inflow"

    @property
    def noise(self) -> str:
        """Of the sensors."""
        return "slow noise" if self.slow_share > 0.0 else "white noise"

    @property
    def pumps(self) -> str:
        """Whether an effect is confined to one pump."""
        told = [values["pump"] for values in self.parameters.values() if "pump" in values]
        return "no effect of pumps" if not told else "one pump" if any(told) else "all pumps"

    def less(self, names: frozenset[str]) -> Self:
        """The label without some of its effects."""
        kept = [(name, at) for name, at in zip(self.names, self.components, strict=True) if name not in names]
        return replace(self, names=tuple(name for name, _ in kept), components=tuple(at for _, at in kept))

    @property
    def title(self) -> str:
        """Row of the confusion matrix."""
        joined = "+".join(self.names)
        return {"none": "none", "open": f"open: {joined}", "leave_one_out": f"without: {joined}"}.get(
            self.kind, joined
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseScore:
    """How an answer compares with a label; None where the question does not arise.

    `top_2` counts a declared equivalent of what is told first. With two true effects `top_1` asks whether what is
    told first is one of them, and `top_2` whether both are told or declared equivalent. Where the truth is not in
    the library, `top_1` and `top_2` do not arise, and "unknown" or a declared equivalent is right.

    `exact_set` asks whether nothing is missing and nothing false beside it, `exact_by_name` the same without what is
    declared equivalent, and `equivalents` has of each told effect how many are. `said` is the probability of the
    answer that the posterior gives most, and whether that very set is the truth.

    A true effect that the answer lists as not tested is neither right nor wrong: of a pair the other is asked for.
    Where none is left, "none" is right, "unknown" neither, and the rest does not arise.
    """

    label: Label
    told: str
    told_names: tuple[str, ...]
    verdict_right: bool | None
    top_1: bool | None
    top_2: bool | None
    component_right: bool | None
    false_attribution: bool | None
    exact_set: bool | None
    exact_by_name: bool | None
    shrinkage: float | None
    parameters: tuple[dict[str, Any], ...]
    equivalents: tuple[int, ...] = ()
    said: tuple[float, bool] | None = None
    not_tested: tuple[str, ...] = ()

    @property
    def is_tested(self) -> bool:
        """Whether the answer has looked for a true effect, or there is none."""
        return not self.not_tested or len(self.not_tested) < len(self.label.names)


def score_case(label: Label, answer: Answer | None, whole: Answer | None = None) -> CaseScore:
    """Score of one answer; None for a diagnosis that failed, which is wrong in all.

    Parameters
    ----------
    label : Label
    answer : Answer or None
    whole : Answer or None
        Of the same diagnosis with the whole library, where a name was left out: it tells what is equivalent to that.
    """
    answer = answer and _without(answer, set(label.inherent) - set(label.names))
    told = answer.verdict if answer else FAILED
    names = answer.names if answer and told == "effect" else ()
    told_untested = frozenset().union(*(one.untested for one in (answer, whole) if one))
    not_tested = tuple(name for name in label.names if name in told_untested)
    if not_tested and len(not_tested) == len(label.names):
        return CaseScore(
            label=label,
            told=told,
            told_names=names,
            verdict_right=None if told == "unknown" else told == "none",
            top_1=None,
            top_2=None,
            component_right=None,
            false_attribution=None,
            exact_set=None,
            exact_by_name=None,
            shrinkage=None,
            parameters=(),
            not_tested=not_tested,
        )
    asked = label.less(told_untested)
    is_known = label.kind in KNOWN_KINDS
    place = answer.where[0].component if answer and answer.where else ""
    expected = VERDICT_OF[label.kind]
    told_by = [one for one in (answer, whole) if one and names]
    named_equivalent = any(_is_equivalent(names[0], asked.names, one) for one in told_by)
    verdict_right = told == expected or (label.kind == "leave_one_out" and named_equivalent)
    return CaseScore(
        label=label,
        told=told,
        told_names=names,
        verdict_right=verdict_right,
        top_1=bool(names and names[0] in asked.names) if is_known else None,
        top_2=_top_2(asked, answer if names else None) if is_known else None,
        component_right=place in asked.components if asked.names else None,
        false_attribution=told == "effect" if label.kind == "none" else None,
        exact_set=bool(answer and names and is_exact_set(answer.sets, asked.names)) if is_known else verdict_right,
        said=_said(label, asked, answer) if answer else None,
        exact_by_name=_is_named(asked, answer, told, is_known=is_known),
        equivalents=tuple(len(effect.equivalent) for effect in answer.effects) if answer and names else (),
        shrinkage=answer.gap.shrinkage if answer and is_known and told == "effect" else 0.0 if is_known else None,
        parameters=tuple(_parameter_rows(asked, answer)) if answer and is_known else (),
        not_tested=not_tested,
    )


def _is_named(asked: Label, answer: Answer | None, told: str, *, is_known: bool) -> bool:
    """Whether the answer is the truth without anything that it declares equivalent."""
    if not is_known or answer is None or told != "effect":
        return told == VERDICT_OF[asked.kind] and not is_known
    return sorted(answer.names) == sorted(asked.names)


def _is_equivalent(told: str, true: Sequence[str], answer: Answer) -> bool:
    """Whether a diagnosis declares an effect and a true one equivalent."""
    return any({told, name} <= {effect.name, *effect.equivalent} for effect in answer.effects for name in true)


def _without(answer: Answer, names: set[str]) -> Answer:
    """Answer less some effects; "none" if it told nothing else."""
    effects = tuple(effect for effect in answer.effects if effect.name not in names)
    if len(effects) == len(answer.effects):
        return answer
    changes = {
        "effects": effects,
        "candidates": tuple(candidate for candidate in answer.candidates if candidate.name not in names),
        "verdict": answer.verdict if effects else "none",
    }
    return answer.model_copy(update=changes)


def _top_2(label: Label, answer: Answer | None) -> bool:
    if answer is None:
        return False
    if len(label.names) == 1:
        return label.names[0] in {*answer.ranking[:2], *answer.effects[0].equivalent}
    return has_all(answer.sets, label.names)


def _said(label: Label, asked: Label, answer: Answer) -> tuple[float, bool] | None:
    """Probability of the answer given most, and whether it is true; what a plant always has counts for nothing."""
    if not answer.posterior:
        return None
    first = max(answer.posterior, key=lambda one: one.probability)
    names = set(first.effects) - (set(label.inherent) - set(label.names))
    verdict = "none" if first.verdict == "effect" and not names else first.verdict
    is_right = verdict == VERDICT_OF[label.kind] and (verdict != "effect" or names == set(asked.names))
    return first.probability, is_right


def _parameter_rows(label: Label, answer: Answer) -> list[dict[str, Any]]:
    """A row for each number that truth and answer both name, of effects that are told by their true name."""
    return [
        row
        for effect in answer.effects
        if effect.name in label.names
        for row in _compared(effect, label.parameters.get(effect.name, {}))
    ]


def _compared(effect: ToldEffect, true_values: Mapping[str, Any]) -> list[dict[str, Any]]:
    rows = []
    for name, parameter in effect.parameters.items():
        true_value, value = true_values.get(name), parameter.value
        if name == "pump" or not isinstance(true_value, int | float) or not isinstance(value, int | float):
            continue
        low, high = parameter.ci or (None, None)
        rows.append(
            {
                "effect": effect.name,
                "parameter": name,
                "truth": float(true_value),
                "value": float(value),
                "relative_error": abs(float(value) - true_value) / max(abs(true_value), 1e-12),
                "is_covered": None if low is None or high is None else low <= true_value <= high,
            }
        )
    return rows


def summary(scores: Sequence[CaseScore]) -> dict[str, Any]:
    """Figures over all cases: shares with Wilson's 95 % interval, medians, coverage; counts.

    Shares range from 0 to 1, best 1, but for `false_attribution` (best 0).
    """
    rows = [row for score in scores for row in score.parameters]
    covered = [row["is_covered"] for row in rows if row["is_covered"] is not None]
    shrinkages = [score.shrinkage for score in scores if score.shrinkage is not None]
    return {
        "cases": len(scores),
        "failed": sum(score.told == FAILED for score in scores),
        "not_tested": sum(bool(score.not_tested) for score in scores),
        **{
            name: share([getattr(score, name) for score in scores])
            for name in (
                "verdict_right",
                "top_1",
                "top_2",
                "component_right",
                "exact_set",
                "exact_by_name",
                "false_attribution",
            )
        },
        "equivalents": _mean([count for score in scores for count in score.equivalents]),
        "shrinkage": {"median": float(np.median(shrinkages)), "mean": float(np.mean(shrinkages))}
        if shrinkages
        else None,
        "parameter_error": {
            "median": float(np.median([row["relative_error"] for row in rows])),
            "count": len(rows),
        }
        if rows
        else None,
        "interval_coverage": share(covered),
    }


def _mean(counts: Sequence[int]) -> dict[str, float] | None:
    """Mean number of what is declared equivalent of a told effect, and how many effects are told."""
    return {"mean": float(np.mean(counts)), "effects": len(counts)} if counts else None


def named_shrinkage(scores: Sequence[CaseScore]) -> dict[str, float] | None:
    """Median and 10th percentile of the shrinkage where what is told first is true; None without any."""
    found = [score.shrinkage for score in scores if score.top_1 and score.shrinkage is not None]
    if not found:
        return None
    low, middle = np.quantile(found, [0.1, 0.5])
    return {"cases": float(len(found)), "median": float(middle), "tenth": float(low)}


def share(answers: Sequence[bool | None]) -> dict[str, Any] | None:
    """Share of yes among those that are not None, with Wilson's 95 % interval; None without any.

    References
    ----------
    .. [1] E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 1927.

    Examples
    --------
    >>> share([True, True, None, False])["value"], share([None])
    (0.6666666666666666, None)
    """
    known = [bool(answer) for answer in answers if answer is not None]
    if not known:
        return None
    n, p, z = len(known), sum(known) / len(known), 1.959964
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return {"value": p, "ci": [max(middle - half, 0.0), min(middle + half, 1.0)], "count": n}


def chance_level(pairs: Sequence[tuple[Label, Answer | None]], rng: np.random.Generator) -> dict[str, float | None]:
    """Mean shares when labels are dealt to the answers at random: what knowing nothing of the case scores."""
    totals: dict[str, list[float]] = {name: [] for name in ("verdict_right", "top_1", "top_2", "component_right")}
    for _ in range(PERMUTATIONS):
        order = rng.permutation(len(pairs))
        dealt = [score_case(pairs[int(k)][0], answer) for k, (_, answer) in zip(order, pairs, strict=True)]
        for name, values in totals.items():
            if (one := share([getattr(score, name) for score in dealt])) is not None:
                values.append(one["value"])
    return {name: float(np.mean(values)) if values else None for name, values in totals.items()}


def confusion(scores: Sequence[CaseScore]) -> tuple[list[str], list[str], Integers]:
    """Rows (what is true), columns (what is told first, or the verdict) and counts; pairs are one row."""
    rows = sorted({_row(score) for score in scores})
    verdicts = (*TELLS[1:], NOT_TESTED, "effect")
    columns = sorted({told for score in scores if (told := _told(score)) not in verdicts})
    columns += [verdict for verdict in verdicts if any(_told(score) == verdict for score in scores)]
    counts = np.zeros((len(rows), len(columns)), dtype=np.int64)
    for score in scores:
        counts[rows.index(_row(score)), columns.index(_told(score))] += 1
    return rows, columns, counts


def _told(score: CaseScore) -> str:
    if score.told_names:
        return score.told_names[0]
    return score.told if score.is_tested or score.told == FAILED else NOT_TESTED


def _row(score: CaseScore) -> str:
    return score.label.kind if score.label.kind in {"pair", "triple"} else score.label.title
