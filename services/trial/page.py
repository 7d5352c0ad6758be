"""The page of a trial: shares by kind, confusion matrix, effects, controls, cases."""

from collections.abc import Mapping, Sequence
from typing import Any

from wetwell.services.reports.charts import Section, bar_chart, heat_map, page, paragraph, table

SHARES = ("verdict_right", "top_1", "top_2", "component_right", "false_attribution", "interval_coverage")


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
    kinds = result["kinds_scored"] | {"all": result["all"]}
    return page(
        f"Trial of seed {result['seed']}",
        [
            Section("What was tried", paragraph(intro)),
            Section("Shares", _bars(kinds) + _share_table("kind", kinds)),
            Section("By plant", _share_table("plant", result["plants_scored"])),
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
    shown = SHARES[:4]
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
        ]
        for name, scores in groups.items()
    ]
    columns = [title, "cases", "failed", "not tested", *SHARES, "median shrinkage", "median parameter error"]
    return table([column.replace("_", " ") for column in columns], rows)


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
        ["case", "kind", "plant", "truth", "told", "verdict right", "component right", "shrinkage"],
        [
            [
                case["label"]["case"],
                case["label"]["kind"],
                case["label"]["plant"],
                ", ".join(case["label"]["names"]),
                ", ".join(case["told_names"]) or case["told"],
                case["verdict_right"],
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
