"""The page of a diagnosis: what an engineer reads first, pictures of it, and the statistics folded."""

import numpy as np

from wetwell.protocols.quantities import pump_column
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.reports.charts import (
    Section,
    Series,
    bar_chart,
    folded,
    heat_map,
    line_chart,
    page,
    paragraph,
    scatter,
    table,
)
from wetwell.services.reports.gap_lead import FULL_SPEED, lead
from wetwell.sim2real.diagnosis.covariates import best_covariate
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.diagnosis.report import DetectorVerdicts, GapReport
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Prediction
from wetwell.sim2real.residuals.bins import SIGNALS
from wetwell.simulator.effects import effects_of

DRAWN_CANDIDATES = 8
SHOWN_S = 1800
SHOWN_ROWS = 60
"""Traces are drawn over so many seconds, and over so many rows at least."""
VERDICT_WORDS = {
    "none": "No gap beyond the noise of the sensors.",
    "unknown": "There is a gap that no effect of the library explains.",
    "effect": "The gap is explained by the effects below.",
}
DRAWN_DUTIES = 400
"""Duties that are drawn, spread over the recording."""


def gap_page(report: GapReport, diagnosis: Diagnosis) -> str:
    """Self-contained HTML page of a diagnosis."""
    gap = report.gap
    statistics = [
        paragraph(
            "The gap is in units of the sensors' noise: 1 is noise alone. The shrinkage is the share of the gap over "
            "the noise that the effects close, on cycles that they were not fitted to."
        ),
        table(
            ["gap on held-out cycles", "before", "after", "floor", "shrinkage", "95 % interval"],
            [["all signals", gap.before, gap.after, gap.floor, gap.shrinkage, _interval(gap.shrinkage_ci)]],
        ),
        table(["signal", "before", "after"], [[name, one.before, one.after] for name, one in gap.by_signal.items()]),
    ]
    words = [
        paragraph(lead(report, diagnosis)),
        paragraph(f"What to do: {report.next_experiment}"),
        *(paragraph(f"Note: {note}.") for note in report.notes),
    ]
    sections = [Section("Verdict", "".join(words))]
    if {"flow_m3h", "head_m"} <= diagnosis.traces.signals.keys():
        sections.append(Section("Head over flow at full speed", _duty(diagnosis)))
    sections.append(Section("Measured and simulated", _traces(diagnosis)))
    if report.effects:
        sections.append(Section("Parameters", _parameters(report)))
    if report.not_tested:
        rows = [[one.effect, one.reason] for one in report.not_tested]
        sections.append(Section("Not tested", table(["effect", "why the recording cannot show it"], rows)))
    if report.where:
        statistics += [_map(report), _residual(report, diagnosis)]
    statistics.append(_ranking(report))
    sections.append(Section("Statistics", folded("Sizes in units of noise, residual, ranking", "".join(statistics))))
    if report.closed_loop is not None:
        sections.append(Section("Closed loop", _closed_loop(report)))
    if report.detector is not None:
        sections.append(Section("Detector", _detector(report.detector)))
    return page(f"Gap between simulation and reality: station {report.station}", sections)


def _duty(diagnosis: Diagnosis) -> str:
    """Measured and simulated duties at full speed, thinned."""
    traces, replay = diagnosis.traces, diagnosis.replay
    shown: list[tuple[str, Traces | Prediction]] = [("measured", traces), ("simulated before", replay.run())]
    if added := effects_of(diagnosis.station)[len(replay.own) :]:
        shown.append(("simulated after", replay.run(added)))
    highest_hz = traces.frequency_hz.max()
    is_full = (traces.frequency_hz >= FULL_SPEED * highest_hz) & (highest_hz > 0.0) & traces.is_row
    pump, second = np.nonzero(is_full)
    chosen = np.linspace(0, pump.size - 1, min(DRAWN_DUTIES, pump.size)).astype(np.int64)
    at = pump[chosen], second[chosen]
    return scatter(
        "Head over flow of each pump at full speed",
        [Series(label, values.signals["flow_m3h"][at], values.signals["head_m"][at]) for label, values in shown],
        x_label="flow in m³/h",
        y_label="head in m",
    )


def _map(report: GapReport) -> str:
    names = [name for name in SIGNALS if any(place.signal == name for place in report.where)]
    size = {(place.signal, place.regime): place.gap for place in report.where}
    values = np.array([[size.get((name, regime), np.nan) for regime in REGIMES] for name in names])
    components = sorted({place.component for place in report.where})
    by_component = {
        (component, regime): sum(p.share for p in report.where if (p.component, p.regime) == (component, regime))
        for component in components
        for regime in REGIMES
    }
    shares = np.array([[by_component[component, regime] for regime in REGIMES] for component in components])
    return heat_map(
        "Share of the gap by component and regime", [c.replace("_", " ") for c in components], REGIMES, shares
    ) + heat_map("Size of the gap by signal and regime, 1 is noise", names, REGIMES, values)


def _parameters(report: GapReport) -> str:
    rows = [
        [effect.name, name, one.value, "–" if one.ci is None else _interval(one.ci), one.unit]
        for effect in report.effects
        for name, one in effect.parameters.items()
    ]
    equivalent = [
        paragraph(f"These data cannot tell {effect.name} from {', '.join(effect.equivalent)}.")
        for effect in report.effects
        if effect.equivalent
    ]
    return table(["effect", "parameter", "value", "95 % interval", "unit"], rows) + "".join(equivalent)


def _traces(diagnosis: Diagnosis) -> str:
    """Half an hour, or some rows, around the worst held-out cycle of the gap."""
    traces, replay = diagnosis.traces, diagnosis.replay
    found, bins = diagnosis.attribution, diagnosis.bins
    by_cycle = np.bincount(bins.cycle[found.validation], found.plain[found.validation] ** 2)
    length_s = max(SHOWN_S, round(SHOWN_ROWS * traces.rate_s))
    begin = max(int(np.argmax(diagnosis.regimes.cycle == int(np.argmax(by_cycle)))) - length_s // 6, 0)
    window = np.arange(begin, min(begin + length_s, traces.seconds))
    if not traces.is_each_second:
        window = window[traces.is_row[window]]
    time_ns = traces.start_ns + NS_PER_S * traces.time_s[window].astype(np.int64)
    added = effects_of(diagnosis.station)[len(replay.own) :]
    running = int(np.argmax((traces.frequency_hz[:, window] > 0.0).sum(axis=1)))
    shown: list[tuple[str, Traces | Prediction]] = [("measured", traces), ("before", replay.run())]
    shown += [("after", replay.run(added))] if added else []
    levels = [Series(label, time_ns, values.level_m[window]) for label, values in shown]
    charts = [line_chart("level_m", levels, y_label="level_m", is_time=True)]
    for name in traces.signals:
        series = [Series(label, time_ns, values.signals[name][running, window]) for label, values in shown]
        charts.append(line_chart(pump_column(running + 1, name), series, y_label=name, is_time=True))
    return "".join(charts)


def _residual(report: GapReport, diagnosis: Diagnosis) -> str:
    first = report.where[0]
    covariate = best_covariate(diagnosis, SIGNALS.index(first.signal))
    series = [Series("before", covariate.values, covariate.before)]
    if report.effects:
        series.append(Series("after", covariate.values, covariate.after))
    return scatter(
        f"Residual of {first.signal.replace('_', ' ')} against {covariate.name}",
        series,
        x_label=covariate.name,
        y_label="residual in units of noise",
    )


def _ranking(report: GapReport) -> str:
    best = report.candidates[:DRAWN_CANDIDATES]
    bars = bar_chart(
        "Share of the gap that each effect closes alone",
        [c.name for c in best],
        {"shrinkage": [c.shrinkage for c in best]},
        y_label="share",
    )
    rows = [[c.name, c.score, c.shrinkage, _interval(c.shrinkage_ci)] for c in best]
    return bars + table(["effect", "score", "shrinkage", "95 % interval"], rows)


def _closed_loop(report: GapReport) -> str:
    loop = report.closed_loop
    if loop is None:
        return ""
    rows: list[list[object]] = [
        ["measured", None, loop.measured_starts_per_day, loop.measured_run_h_per_day],
        *[
            [name, f"{one.level_nmae:.2%}", one.starts_per_day, one.run_h_per_day]
            for name, one in (("simulated before", loop.before), ("simulated after", loop.after))
        ],
    ]
    return table(["", "level NMAE", "starts a day", "run time a day in h"], rows)


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


def _interval(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.4g} to {pair[1]:.4g}"
