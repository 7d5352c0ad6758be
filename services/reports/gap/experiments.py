"""Acts that would tell apart what a diagnosis leaves, as a table that is opened when it is wanted."""

from collections.abc import Sequence

from wetwell.services.reports.charts import folded, paragraph, percent, table
from wetwell.services.reports.gap.lead import effect_words
from wetwell.sim2real.diagnosis.report import GapReport
from wetwell.sim2real.experiments.reported import OrderedStep, ProposedAct

_WHAT_IT_SAYS = (
    "Each act was simulated under every answer that is left. Information is what it is expected to tell: 1 bit "
    "answers one question of yes or no. The truth is the probability that the right answer is expected to have "
    "afterwards. The price is that of energy and work{prices}. An act tells answers apart where the evidence is "
    "expected to be 19 to 1."
)
_HEAD = ("what to do", "information in bit", "truth", "price", "work in h", "takes h", "water in m³", "energy in kWh")


def experiments_table(report: GapReport, *, are_prices_default: bool) -> str:
    """Ready-made HTML: what each act brings and costs, its limits, and which acts may not be done; empty without any.

    Parameters
    ----------
    report : GapReport
    are_prices_default : bool
        Whether the station file says no costs.
    """
    if not report.experiments and not report.refused:
        return ""
    body = ""
    if report.experiments:
        prices = ", at default prices: the station file has no costs" if are_prices_default else ""
        head = [*_HEAD, "limits", "tells apart"]
        body += paragraph(_WHAT_IT_SAYS.format(prices=prices)) + table(
            head, [_row(act) for act in report.experiments]
        )
    if report.refused:
        rows = [[effect_words(act.act), act.reason] for act in report.refused]
        body += paragraph("May not be done at this station:") + table(["act", "rule that it would break"], rows)
    return folded("Which acts would tell more, and what they cost", body)


def _row(act: ProposedAct) -> list[object]:
    apart = "; ".join(" and ".join(map(effect_words, names)) or "nothing" for names in act.separates)
    return [
        act.sentence,
        f"{act.information_bits:.2f}",
        percent(act.truth_probability),
        f"{act.price:.0f}",
        f"{act.crew_h:.1f}",
        f"{act.length_h:.1f}",
        f"{act.costs_m3:.0f}",
        f"{act.extra_kwh:+.1f}",
        limits_words(act.steps),
        apart or "none for sure",
    ]


def limits_words(steps: Sequence[OrderedStep]) -> str:
    """Within which limits an act stays, in words.

    Examples
    --------
    >>> step = OrderedStep(longest_s=3600.0, speed_ratio=(0.9, 0.0), low_m=0.5, high_m=None, is_valve_shut=False,
    ...                    is_inlet_shut=True)
    >>> limits_words([step, step.model_copy(update={"high_m": 2.1, "is_inlet_shut": False})])
    'level 0.5 to 2.1 m; pump 1 at 90 %; inlet shut'
    """
    lows = [step.low_m for step in steps if step.low_m is not None]
    highs = [step.high_m for step in steps if step.high_m is not None]
    low, high = (f"{min(lows):.3g}" if lows else "", f"{max(highs):.3g} m" if highs else "")
    level = (
        f"level {low} to {high}" if lows and highs else f"level down to {low} m" if lows else f"level up to {high}"
    )
    speeds = {
        pump: min(step.speed_ratio[pump] for step in steps if step.speed_ratio and step.speed_ratio[pump] > 0.0)
        for pump in sorted({place for step in steps for place, one in enumerate(step.speed_ratio or ()) if one > 0.0})
    }
    parts = [
        level if lows or highs else "",
        *(f"pump {pump + 1} at {100.0 * ratio:.0f} %" for pump, ratio in speeds.items()),
        "valves shut" if any(step.is_valve_shut for step in steps) else "",
        "inlet shut" if any(step.is_inlet_shut for step in steps) else "",
    ]
    return "; ".join(filter(None, parts)) or "none"
