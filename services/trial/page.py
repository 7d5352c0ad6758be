"""The page of a trial: shares by kind, confusion matrix, effects, controls, cases."""

from collections.abc import Mapping, Sequence
from typing import Any

from wetwell.services.reports.charts import Section, Series, bar_chart, heat_map, line_chart, page, paragraph, table

SHARES = (
    "verdict_right",
    "exact_set",
    "exact_by_name",
    "top_1",
    "top_2",
    "component_right",
    "false_attribution",
    "interval_coverage",
)


def trial_page(result: Mapping[str, Any], cases: Sequence[Mapping[str, Any]]) -> str:
    """Self-contained page of a trial.

    Parameters
    ----------
    result : mapping
        What `trial.json` holds, without the cases.
    cases : sequence of mappings
        One a case.
    """
    intro = (
        f"{result['count']} cases of seed {result['seed']}, {result['length_s'] / 86_400:g} days each, by "
        f"{' and '.join(result['plants'])}; wetwell {result['version']}, {result['date']}. The diagnosis saw station "
        "file and recording only; the labels were sealed before and opened after it."
    )
    if result["looked_at"]:
        intro += (
            f" The cases of this seed were looked at, so that these are no headline figures: {result['looked_at']}."
        )
    kinds = result["kinds_scored"] | {"all": result["all"]}
    return page(
        f"Trial of seed {result['seed']}",
        [
            Section("What was tried", paragraph(intro)),
            Section("Shares", _bars(kinds) + _share_table("kind", kinds)),
            Section("By plant", _share_table("plant", result["plants_scored"])),
            *(
                [Section("Probabilities", _reliability(result["reliability"]))]
                if result["reliability"]["all"]
                else []
            ),
            *(Section(f"By {name}", _split(name, groups)) for name, groups in result["splits"].items()),
            Section("Truth against answer", _confusion("all cases", result["confusion"])),
            Section("Single effects", _share_table("effect", result["effects_scored"])),
            Section("Controls", _controls(result["controls"])),
            *([Section("Unseen recordings", _holdout(result["unseen"]))] if result["unseen"] else []),
            Section("Cases", _cases(cases)),
        ],
    )


def _split(name: str, groups: Mapping[str, Mapping[str, Any]]) -> str:
    shares = _share_table(name, {group: parts["scores"] for group, parts in groups.items()})
    if len(groups) < 2:
        return shares
    return shares + "".join(_confusion(group, parts["confusion"]) for group, parts in groups.items())


def _confusion(which: str, matrix: Mapping[str, Any]) -> str:
    return heat_map(
        f"Cases by truth and by what was told first: {which}",
        matrix["rows"],
        matrix["columns"],
        matrix["counts"],
        row_label="truth",
        column_label="told",
    )


def _bars(groups: Mapping[str, Mapping[str, Any]]) -> str:
    shown = SHARES[:5]
    heights = {name: [_value(scores[name]) for scores in groups.values()] for name in shown}
    return bar_chart("Share of right answers", list(groups), heights, y_label="1")


def _share_table(title: str, groups: Mapping[str, Mapping[str, Any]]) -> str:
    rows = [
        [
            name,
            scores["cases"],
            scores["failed"],
            scores["not_tested"],
            *(_share(scores[key]) for key in SHARES),
            (scores["shrinkage"] or {}).get("median"),
            (scores["parameter_error"] or {}).get("median"),
            (scores["equivalents"] or {}).get("mean"),
        ]
        for name, scores in groups.items()
    ]
    medians = ("median shrinkage", "median parameter error", "equivalents of an effect")
    columns = [title, "cases", "failed", "not tested", *SHARES, *medians]
    return table([column.replace("_", " ") for column in columns], rows)


def _reliability(groups: Mapping[str, Any]) -> str:
    """Diagram of what was said and how often it was right, and the error of each group."""
    bins = groups["all"]["bins"]
    diagram = line_chart(
        "Share right against the probability that was told: a calibrated one lies on the line",
        [
            Series("right", [one["said"] for one in bins], [one["right"] for one in bins]),
            Series("calibrated", [0.0, 1.0], [0.0, 1.0]),
        ],
        x_label="probability of the answer given most",
        y_label="share right",
    )
    rows = [
        [f"{one['from']:.2f} to {one['to']:.2f}", one["cases"], f"{one['said']:.2f}", f"{one['right']:.2f}"]
        for one in bins
    ]
    errors = [
        [
            group,
            found["cases"],
            f"{found['calibration_error']:.3f}",
            f"{found['chance']:.3f}",
            f"{found['brier']:.3f}",
        ]
        for group, found in groups.items()
        if found
    ]
    return (
        diagram
        + table(["probability", "cases", "mean told", "share right"], rows)
        + table(["cases of", "cases", "expected calibration error", "by chance alone", "Brier score"], errors)
    )


def _controls(controls: Mapping[str, Any]) -> str:
    chance = controls["permuted_labels"]
    rows: list[list[object]] = [["labels dealt at random (chance)", *chance.values(), None]]
    if "recalibration_only" in controls:
        lower = controls["recalibration_only"]
        shares = [(lower[name] or {}).get("value") for name in chance]
        rows.append(
            ["recalibration only (lower bound, single and pair)", *shares, (lower["shrinkage"] or {}).get("median")]
        )
    return table(["control", *(name.replace("_", " ") for name in chance), "median shrinkage"], rows)


def _holdout(figures: Mapping[str, Any]) -> str:
    rows = [
        ["station file as it was", figures["before"], None],
        ["diagnosed station", figures["after"], (figures["shrinkage"] or {}).get("median")],
        [
            "flexible regressor of the residuals (upper bound without a cause)",
            figures["regressor"],
            (figures["regressor_shrinkage"] or {}).get("median"),
        ],
        ["oracle", figures["oracle"], 1.0],
    ]
    return table(["model", "median gap in units of noise", "median shrinkage"], rows) + paragraph(
        f"{figures['cases']} cases, other weather and noise, the same truth."
    )


def _cases(cases: Sequence[Mapping[str, Any]]) -> str:
    return table(
        ["case", "kind", "plant", "truth", "told", "verdict right", "exact set", "component right", "shrinkage"],
        [
            [
                case["label"]["case"],
                case["label"]["kind"],
                case["label"]["plant"],
                ", ".join(case["label"]["names"]),
                ", ".join(case["told_names"]) or case["told"],
                case["verdict_right"],
                case["exact_set"],
                case["component_right"],
                case["shrinkage"],
            ]
            for case in cases
        ],
    )


def _value(share: Mapping[str, Any] | None) -> float:
    return float("nan") if share is None else float(share["value"])


def _share(share: Mapping[str, Any] | None) -> str | None:
    return None if share is None else f"{share['value']:.2f} [{share['ci'][0]:.2f}, {share['ci'][1]:.2f}]"
