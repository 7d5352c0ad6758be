"""What `wetwell gap diagnose` prints."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from wetwell.services.reports.text_table import folded
from wetwell.sim2real.diagnosis.report import FoundEffect, GapReport

PLACES = 4
PRINTED_CANDIDATES = 5
STORED = {"instant": "a value in", "mean": "means of", "held": "values held, looked at each"}
"""Words for what a stored value stands for, before the seconds from row to row."""


@contextmanager
def progress_bar(name: str) -> Iterator[Callable[[float], None]]:
    """Progress bar on standard error; gets the share that is done."""
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(name, total=1.0)
        yield lambda share: progress.update(task, completed=share)


def gap_lines(report: GapReport, out: Path) -> str:
    """Summary of a report for people."""
    gap = report.gap
    lines = [
        (
            f"station '{report.station}', {report.cycles} cycles, {STORED[report.value]} {report.rate_s:g} s: "
            f"{report.verdict}"
        ),
        (
            f"gap on held-out cycles: {gap.before:.2f} before, {gap.after:.2f} after, {gap.floor:.0f} is noise; "
            f"shrinkage {gap.shrinkage:.1%} ({gap.shrinkage_ci[0]:.1%} to {gap.shrinkage_ci[1]:.1%})"
        ),
    ]
    lines += [
        f"  where   {p.component:13} {p.signal:12} {p.regime:11} gap {p.gap:7.2f}   {p.share:.0%}"
        for p in report.where[:PLACES]
    ]
    for effect in report.effects:
        lines.append(f"  effect  {effect.name}: {_values(effect)}")
        if effect.equivalent:
            lines.append(f"          not to be told from {', '.join(effect.equivalent)}")
    lines += [f"  beside  {one.name}: {_values(one)}; each station has some" for one in report.companions]
    if (learnt := report.correction) is not None:
        low, high = learnt.shrinkage_ci
        lines += [f"  correction {learnt.equation}", f"  {learnt.sentence}"]
        lines.append(
            f"  it closes {learnt.shrinkage:.1%} ({low:.1%} to {high:.1%}) of the gap in times that gave no sizes"
        )
        lines += [
            f"  not to be told from {one.equation}, which would lie in the {one.component.replace('_', ' ')}"
            for one in learnt.equivalent
        ]
    lines += [f"  ranking {c.name:28} shrinks by {c.shrinkage:.1%}" for c in report.candidates[:PRINTED_CANDIDATES]]
    if (loop := report.closed_loop) is not None:
        lines.append(
            f"closed loop: level NMAE {loop.before.level_nmae:.2%} before, {loop.after.level_nmae:.2%} after; "
            f"starts a day {loop.measured_starts_per_day:.1f} measured, {loop.before.starts_per_day:.1f} before, "
            f"{loop.after.starts_per_day:.1f} after"
        )
    if (told := report.detector) is not None:
        lines.append(
            f"detector: {told.false_per_day_before:g} verdicts a day call a fault with the station as configured, "
            f"{told.false_per_day_after:g} as diagnosed" + ("" if told.has_new_curves else " (same curves)")
        )
    lines += [f"not tested: {one.effect}: {one.reason}" for one in report.not_tested]
    lines += [f"note: {note}" for note in report.notes]
    lines += [f"next: {report.next_experiment}", f"{out}: report.json, report.html, station.toml"]
    return folded("\n".join(lines))


def _values(effect: FoundEffect) -> str:
    """Parameters of an effect, with their intervals and units."""
    return ", ".join(
        f"{name} = {one.value if isinstance(one.value, str) else format(one.value, '.4g')}"
        + ("" if one.ci is None else f" ({one.ci[0]:.4g} to {one.ci[1]:.4g})")
        + (f" {one.unit}" if one.unit not in {"", "1"} else "")
        for name, one in effect.parameters.items()
    )
