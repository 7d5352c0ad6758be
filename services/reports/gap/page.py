"""The page of a diagnosis: what an engineer reads first, pictures of it, and the statistics folded."""

from collections.abc import Iterable

from wetwell.services.reports.charts import Section, folded, page, paragraph, percent, share_bars, table
from wetwell.services.reports.gap.correction import correction_section
from wetwell.services.reports.gap.experiments import experiments_table
from wetwell.services.reports.gap.lead import effect_words, lead, shrinkage_words
from wetwell.services.reports.gap.pictures import duty_picture, trace_pictures
from wetwell.services.reports.gap.statistics import statistics
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.diagnosis.report import AnswerProbability, GapReport
from wetwell.sim2real.likelihood.posterior import MISJUDGED

DRAWN = 1e-3
"""Probability from which on an answer or a part is drawn."""
WORDS_OF = {"none": "no difference that matters", "unknown": "something unknown"}


def gap_page(report: GapReport, diagnosis: Diagnosis) -> str:
    """Self-contained HTML page of a diagnosis."""
    first = [
        paragraph(lead(report, diagnosis)),
        paragraph(f"What to do: {report.next_experiment}"),
        experiments_table(report, are_prices_default=diagnosis.station.costs is None),
        *([paragraph(shrinkage_words(report))] if report.effects else []),
        *(paragraph(f"Note: {note}.") for note in report.notes),
    ]
    sections = [Section("What it says", "".join(first)), Section("How sure that is", _posterior(report))]
    if diagnosis.correction is not None:
        section = correction_section(diagnosis.correction, diagnosis)
        sections.append(Section("An equation for what nobody has named", section))
    if {"flow_m3h", "head_m"} <= diagnosis.traces.signals.keys():
        sections.append(Section("Head over flow", duty_picture(diagnosis)))
    sections.append(Section("Measured and simulated", trace_pictures(diagnosis)))
    if report.effects:
        sections.append(Section("Parameters", _parameters(report)))
    sections.append(Section("What was not tested", _not_tested(report)))
    sections.append(
        Section("Statistics", folded("How the answer was found, in numbers", statistics(report, diagnosis)))
    )
    return page(f"Gap between simulation and reality: station {report.station}", sections)


def _posterior(report: GapReport) -> str:
    shares = {answer_words(one): one.probability for one in report.posterior if one.probability >= DRAWN}
    rest = 1.0 - sum(shares.values())
    if rest >= DRAWN:
        shares["all others"] = rest
    words = (
        "The answers exclude one another, so their probabilities sum to 100 %. None gets more than "
        f"{percent(1.0 - MISJUDGED)}, however clear: of such answers on sealed recordings, one in ten is wrong."
    )
    bars = paragraph(words) + share_bars("Probability of each answer", shares)
    places = {effect_words(name): share for name, share in report.component_probability.items() if share >= DRAWN}
    return bars + (share_bars("Probability that something is otherwise there", places) if places else "")


def answer_words(answer: AnswerProbability) -> str:
    """An answer in words."""
    return WORDS_OF.get(answer.verdict) or " and ".join(map(effect_words, answer.effects))


def _parameters(report: GapReport) -> str:
    rows = [
        [
            effect_words(effect.name),
            effect_words(name),
            one.value,
            "–" if one.ci is None else f"{one.ci[0]:.4g} to {one.ci[1]:.4g}",
            "–" if one.unit in {"", "1"} else one.unit,
        ]
        for effect in (*report.effects, *report.companions)
        for name, one in effect.parameters.items()
    ]
    equivalent = [
        paragraph(f"These data cannot tell {effect_words(effect.name)} from {_listed(effect.equivalent)}.")
        for effect in report.effects
        if effect.equivalent
    ]
    beside = [
        paragraph(
            f"Each station has some {effect_words(one.name)}, and here that is no answer. With its size the "
            "simulator comes closer to cycles that it was not fitted to, so station.toml holds it."
        )
        for one in report.companions
    ]
    return table(["effect", "parameter", "value", "95 % interval", "unit"], rows) + "".join((*equivalent, *beside))


def _listed(names: Iterable[str]) -> str:
    return ", ".join(map(effect_words, names))


def _not_tested(report: GapReport) -> str:
    if not report.not_tested:
        return paragraph("All effects that were tried can be seen in this recording.")
    words = "The recording cannot show these effects, so the answer says nothing of them."
    rows = [[effect_words(one.effect), one.reason] for one in report.not_tested]
    return paragraph(words) + table(["effect", "why the recording cannot show it"], rows)
