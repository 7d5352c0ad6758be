"""The result of a backtest as one HTML page."""

from collections.abc import Mapping, Sequence
from typing import Any

from wetwell.services.reports.charts import Section, Series, heat_map, line_chart, page, paragraph, table

Figures = Mapping[str, Any]


def backtest_page(result: Figures) -> str:
    """Self-contained page: a table over all detectors, then the figures of each."""
    detectors: Mapping[str, Figures] = result["detectors"]
    return page(
        "wetwell backtest",
        [
            Section("Overview", _overview(result)),
            Section("Faults", _faults(detectors)),
            *(Section(name, _detector(name, figures)) for name, figures in detectors.items()),
            Section("Recordings", table(["recording"], [[name] for name in result["recordings"]])),
            *_failed(result),
        ],
    )


def _failed(result: Figures) -> list[Section]:
    rows = [[one["recording"], one["error"]] for one in result["failed"]]
    return [Section("Not scored", table(["recording", "error"], rows))] if rows else []


def _overview(result: Figures) -> str:
    detectors: Mapping[str, Figures] = result["detectors"]
    first = next(iter(detectors.values()))
    told = (
        f"{len(result['recordings'])} recordings, {first['station_days']:.1f} station-days, "
        f"version {result['version']}. "
        f"Runs that end in the first {result['learning_h']:g} h are not scored. A verdict of unknown, or of learning "
        "after that, counts as a miss in recall and F1. Intervals are exact and hold 95 %; delays are from the first "
        "second of a fault, and a dash there means that more faults were missed than the figure allows."
    )
    columns = [
        "detector",
        "runs",
        "macro F1",
        "mean by recording",
        "5 % of recordings",
        "false alarms per station-day",
        "interval",
        "unknown",
        "learning",
        "s per station-day",
    ]
    rows = [
        [
            name,
            figures["runs"],
            figures["macro_f1"],
            figures["macro_f1_by_recording"]["mean"],
            figures["macro_f1_by_recording"]["quantile_5"],
            figures["false_alarms"]["per_station_day"],
            _interval(figures["false_alarms"]["interval_95"]),
            figures["abstention"]["unknown"],
            figures["abstention"]["learning"],
            figures["judging_s_per_station_day"],
        ]
        for name, figures in detectors.items()
    ]
    states = list(first["states"])
    scores = heat_map(
        "F1 by true state",
        list(detectors),
        states,
        [[figures["states"][state]["f1"] for state in states] for figures in detectors.values()],
    )
    return paragraph(told) + table(columns, rows) + scores


def _faults(detectors: Mapping[str, Figures]) -> str:
    rows = [
        [
            name,
            state,
            found["faults"],
            found["missed"],
            found["delay_s"]["median"],
            found["delay_s"]["quantile_95"],
            found["steady_delay_s"]["median"],
            found["severity_at_alarm"]["median"],
        ]
        for name, figures in detectors.items()
        for state, found in figures["detection"].items()
    ]
    columns = [
        "detector",
        "fault",
        "number",
        "missed",
        "delay, median [s]",
        "delay, 95 % [s]",
        "delay from the first steady sample, median [s]",
        "severity at alarm, median",
    ]
    return table(columns, rows) if rows else paragraph("No fault began after learning.")


def _detector(name: str, figures: Figures) -> str:
    confusion = figures["confusion"]
    kept = [row for row, runs in enumerate(confusion["runs"]) if sum(runs)]
    lengths = figures["run_length"]
    return "".join(
        [
            heat_map(
                f"Runs by truth and verdict: {name}",
                [confusion["truth"][row] for row in kept],
                confusion["told"],
                [confusion["runs"][row] for row in kept] if kept else [[]],
                row_label="truth",
                column_label="told",
            )
            if kept
            else "",
            table(
                ["state", "runs", "precision", "recall", "F1"],
                [[state, *row.values()] for state, row in figures["states"].items()],
            ),
            table(
                [
                    "false alarms",
                    "station-days",
                    "healthy runs to a false alarm",
                    "interval",
                    "runs to detection, median",
                ],
                [
                    [
                        figures["false_alarms"]["count"],
                        figures["false_alarms"]["station_days"],
                        lengths["healthy"],
                        _interval(lengths["healthy_interval_95"]),
                        lengths["faulty_median"],
                    ]
                ],
            ),
            _recall_tables(figures),
            _reliability(figures["reliability"]),
        ]
    )


def _recall_tables(figures: Figures) -> str:
    parts = []
    if figures["kinds"]:
        parts.append(
            table(["kind", "runs", "recall", "any fault told"], [list(row.values()) for row in figures["kinds"]])
        )
    if figures["severities"]:
        columns = ["truth", "severity from", "to", "runs", "recall", "any fault told"]
        parts.append(table(columns, [list(row.values()) for row in figures["severities"]]))
    return "".join(parts)


def _reliability(figures: Figures | None) -> str:
    if figures is None:
        return paragraph("Gives no probabilities.")
    bins: Sequence[Figures] = figures["bins"]
    given = [row["mean_probability"] for row in bins]
    chart = line_chart(
        "Reliability of the posterior",
        [
            Series("share of faults", given, [row["fault_share"] for row in bins]),
            Series("interval from", given, [row["interval_95"][0] for row in bins]),
            Series("interval to", given, [row["interval_95"][1] for row in bins]),
            Series("perfect", [0.0, 1.0], [0.0, 1.0]),
        ],
        x_label="probability of a fault",
        y_label="share of faults",
    )
    rows = [
        [
            f"{row['from']:g} to {row['to']:g}",
            row["runs"],
            row["mean_probability"],
            row["fault_share"],
            _interval(row["interval_95"]),
        ]
        for row in bins
    ]
    scores = (
        f"Expected calibration error {figures['expected_error']:.4f}, Brier score {figures['brier']:.4f}, "
        f"logarithmic score {figures['log_score']:.4f}; 0 is best."
    )
    return (
        chart
        + table(["probability of a fault", "runs", "mean", "share of faults", "interval"], rows)
        + paragraph(scores)
    )


def _interval(ends: Sequence[float | None] | None) -> str | None:
    """Two ends as text; an end that is None is infinite."""
    if ends is None:
        return None
    return " to ".join("∞" if end is None else f"{end:.3g}" for end in ends)
