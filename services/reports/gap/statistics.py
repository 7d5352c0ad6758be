"""The statistics of a diagnosis, for who wants to know how the answer was found."""

import numpy as np

from wetwell.services.reports.charts import Series, heat_map, paragraph, percent, scatter, share_bars, table
from wetwell.services.reports.gap.lead import effect_words
from wetwell.sim2real.diagnosis.covariates import best_covariate
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.diagnosis.report import ClosedLoopComparison, DetectorVerdicts, GapReport
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.residuals.bins import SIGNALS

DRAWN_CANDIDATES = 8


def statistics(report: GapReport, diagnosis: Diagnosis) -> str:
    """Ready-made HTML: the gap by signal, place and effect, the check of the noise, the free run, the detector."""
    parts = [_gap(report)]
    if report.where:
        parts += [_map(report), _residual(report, diagnosis)]
    parts += [_ranking(report), _noise(report)]
    if report.closed_loop is not None:
        parts.append(_closed_loop(report.closed_loop))
    if report.detector is not None:
        parts.append(_detector(report.detector))
    return "".join(parts)


def _gap(report: GapReport) -> str:
    gap = report.gap
    words = (
        "The gap is the size of the differences in units of what the sensors may be off: 1 is noise alone. It is "
        "taken on cycles that no effect was fitted to."
    )
    rows = [["all signals", gap.before, gap.after]]
    rows += [[_words(name), one.before, one.after] for name, one in gap.by_signal.items()]
    return paragraph(words) + table(["gap", "before", "after"], rows)


def _map(report: GapReport) -> str:
    names = [name for name in SIGNALS if any(place.signal == name for place in report.where)]
    size = {(place.signal, place.regime): place.gap for place in report.where}
    values = np.array([[size.get((name, regime), np.nan) for regime in REGIMES] for name in names])
    regimes = [_words(regime) for regime in REGIMES]
    title = "Gap by signal and by what the station was doing, 1 is noise"
    shares = {f"{_words(place.signal)}, {_words(place.regime)}": place.share for place in report.where}
    return heat_map(title, [_words(name) for name in names], regimes, values) + share_bars(
        "Share of the whole gap", shares
    )


def _residual(report: GapReport, diagnosis: Diagnosis) -> str:
    first = report.where[0]
    covariate = best_covariate(diagnosis, SIGNALS.index(first.signal))
    series = [Series("before", covariate.values, covariate.before)]
    if report.effects:
        series.append(Series("after", covariate.values, covariate.after))
    return scatter(
        f"What is left of {_words(first.signal)} over {covariate.name}",
        series,
        x_label=covariate.name,
        y_label="difference in units of noise",
    )


def _ranking(report: GapReport) -> str:
    best = report.candidates[:DRAWN_CANDIDATES]
    bars = share_bars(
        "Share of the gap that each effect closes alone", {effect_words(one.name): one.shrinkage for one in best}
    )
    rows = [[effect_words(c.name), percent(c.shrinkage), " to ".join(map(percent, c.shrinkage_ci))] for c in best]
    return bars + table(["effect, alone", "share that it closes", "95 % interval"], rows)


def _noise(report: GapReport) -> str:
    if not report.noise_check:
        return ""
    words = (
        "Whether the answer leaves as little as it should: the mean square of what is left, where 1 is all that a "
        "right model may be off. Of a right answer it lies between the share of the sensors and 1."
    )
    rows = [[_words(c.signal), _words(c.regime), c.mean_square, c.noise_share] for c in report.noise_check]
    return paragraph(words) + table(["signal", "the station was doing", "what is left", "share of the sensors"], rows)


def _closed_loop(loop: ClosedLoopComparison) -> str:
    words = f"The simulator running free under the inflow ({loop.inflow}), with its own starts and stops."
    rows: list[list[object]] = [
        ["measured", None, loop.measured_starts_per_day, loop.measured_run_h_per_day],
        *[
            [name, f"{one.level_nmae:.2%}", one.starts_per_day, one.run_h_per_day]
            for name, one in (("simulated before", loop.before), ("simulated after", loop.after))
        ],
    ]
    head = ["", "mean error of the level over its range", "starts a day", "run time in h a day"]
    return paragraph(words) + table(head, rows)


def _detector(told: DetectorVerdicts) -> str:
    same = "The detector learns its baseline in the first six hours, so that constant effects make little difference."
    if not told.has_new_curves:
        same = "No effect changes a curve that the detector uses: its verdicts stay the same."
    rows = [["as configured", told.false_per_day_before], ["as diagnosed", told.false_per_day_after]]
    return (
        paragraph(f"Verdicts that call a fault on this recording of {told.days:.3g} days, taken to be healthy:")
        + table(["station", "faults called a day"], rows)
        + paragraph(same)
    )


def _words(name: str) -> str:
    return name.replace("_", " ")
