"""Draft of a mapping: TOML with all that was assumed as comments, for somebody who knows the plant to complete."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wetwell.protocols.recordings.importers.draft.look import Look, Seen, look
from wetwell.protocols.recordings.importers.draft.stored_value import looks_like_means
from wetwell.protocols.recordings.importers.draft.tag_names import (
    TagGuess,
    number_pumps,
    of_loops,
    recognise,
    recognise_main_flow,
)
from wetwell.protocols.recordings.importers.draft.unit_names import UnitGuess, unit_in, unit_of
from wetwell.protocols.recordings.importers.signals.main_flow import RUN_QUANTITIES, is_main_flow
from wetwell.protocols.recordings.importers.signals.scaling import RUNNING_WORDS, STANDING_WORDS
from wetwell.protocols.recordings.importers.tables.opening import open_export
from wetwell.protocols.units import house_unit

_GOOD = ("good", "192", "ok", "valid", "gut", "hyvä", "bon", "bonne", "bueno", "1", "0")
"""Qualities that are taken for good, the surest first."""

_PRESSURES = frozenset({"kPa", "Pa", "bar", "mbar", "psi"})
_STEADY = 0.6
"""A tag is stored on change if fewer of its steps are the usual one, or if these cover so much less of its time than
those of another tag. [1]"""
_OF_RUNS = ("frequency_hz", "flow_m3h", "power_kw", "main1_flow_m3h")
_MEAN_WHY = "the first row of a run mostly holds a part of the next one; of the interval that ends at the stamp"
_ORDER = ("level_m", "inflow_m3h", "main1_flow_m3h", "frequency_hz", "flow_m3h", "head_m", "power_kw", "running")


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A drafted mapping: its text, what it assumes, and the tags that it does not use."""

    text: str
    assumed: dict[str, str]
    unmapped: list[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Signal:
    tag: str
    seen: Seen
    guess: TagGuess
    unit: UnitGuess | None


def draft_of(paths: Sequence[Path]) -> Draft:
    """Draft of a mapping for the files of an export.

    Raises
    ------
    RecordingError
        If a file cannot be read, or no column holds times.
    """
    files = [open_export(path) for path in paths]
    looked = look(files)
    assumed: dict[str, str] = dict(files[0].assumed)
    lines = [
        f"# Drafted from {paths[0].name}. What was assumed stands behind each line: check it, above all the units."
    ]
    lines += [f"station = {_quoted(_station_name(paths[0]))}  # assumed: the name of the file"]
    signals, unmapped = _signals(looked)
    lines += [f'layout = "{looked.layout}"', *_time_lines(looked, assumed), *_value_lines(looked, signals, assumed)]
    lines += ["", "[columns]", *_column_lines(looked, assumed)]
    pumps = number_pumps({signal.guess.pump for signal in signals if signal.guess.pump})
    taken: dict[str, _Signal] = {}
    for signal in signals:
        number = pumps.get(signal.guess.pump)
        name = signal.guess.quantity if number is None else f"pump{number}_{signal.guess.quantity}"
        if name in taken:
            unmapped[signal.tag] = f"{name} is {_quoted(taken[name].tag)} already"
        else:
            taken[name] = signal
    order = sorted(
        taken, key=lambda name: (pumps.get(taken[name].guess.pump, 0), _ORDER.index(taken[name].guess.quantity))
    )
    for name in order:
        lines += ["", f"[signal.{name}]", *_signal_lines(name, taken[name], assumed)]
        if is_main_flow(name):
            lines.append(f"pumps = {list(pumps.values())}  # assumed: all; CHECK, and that it is no inflow")
    lines += ["", *(f"# not used: {_quoted(tag)}{_because(why)}" for tag, why in unmapped.items())]
    return Draft(text="\n".join(lines).rstrip("\n") + "\n", assumed=assumed, unmapped=list(unmapped))


def _signals(looked: Look) -> tuple[list[_Signal], dict[str, str]]:
    """Tags that seem to be signals, and why the others are not."""
    signals, unmapped = [], {}
    units = {tag: unit_of(seen.unit_text) or unit_in(tag) for tag, seen in looked.tags.items()}
    loops = of_loops(looked.tags)
    for tag, seen in looked.tags.items():
        guess = recognise(tag, units[tag]) or loops.get(tag)
        if guess is None:
            unmapped[tag] = f"unit {seen.unit_text}" if seen.unit_text else ""
        else:
            signals.append(_Signal(tag=tag, seen=seen, guess=guess, unit=units[tag]))
    _add_main_flow(looked, units, signals, unmapped)
    return signals, unmapped


def _add_main_flow(
    looked: Look, units: Mapping[str, UnitGuess | None], signals: list[_Signal], unmapped: dict[str, str]
) -> None:
    """Take the one flow that names no pump for that of the main, where no pump has its own and all runs are told."""
    pumps = number_pumps({signal.guess.pump for signal in signals if signal.guess.pump})
    found = {tag: recognise_main_flow(tag, units[tag]) for tag in unmapped if looked.tags[tag].span is not None}
    guesses = {tag: guess for tag, guess in found.items() if guess is not None}
    if not pumps or not guesses or any(signal.guess.quantity == "flow_m3h" for signal in signals):
        return
    runs = {signal.guess.pump for signal in signals if signal.guess.quantity in RUN_QUANTITIES}
    silent = [pump for pump in pumps if pump not in runs]
    if len(guesses) > 1 or silent:
        why = f"but nothing tells when pump {silent[0]} runs" if silent else f"or one of {len(guesses) - 1} more?"
        unmapped |= dict.fromkeys(guesses, f"names no pump; main1_flow_m3h, {why}")
        return
    ((tag, guess),) = guesses.items()
    del unmapped[tag]
    signals.append(_Signal(tag=tag, seen=looked.tags[tag], guess=guess, unit=units[tag]))


def _time_lines(looked: Look, assumed: dict[str, str]) -> list[str]:
    lines = []
    if looked.formats:
        other = f"; or is it {looked.formats[1]}? the stamps do not say" if len(looked.formats) > 1 else ""
        lines.append(f"time_format = {_quoted(looked.formats[0])}  # assumed from the stamps{other}")
        assumed["time_format"] = repr(looked.formats[0]) + other
    if looked.has_offset:
        return [*lines, "# time_zone: not needed, every stamp is in UTC or has an offset"]
    assumed["time_zone"] = "missing: must be said, the stamps have no offset"
    return [*lines, '# time_zone = "Europe/Helsinki"  # MUST BE SAID: the stamps have no offset']


def _value_lines(looked: Look, signals: Sequence[_Signal], assumed: dict[str, str]) -> list[str]:
    steps_s = [np.concatenate(parts) for parts in looked.steps_s.values()]
    steps_s = [steps for steps in (part[part > 0.0] for part in steps_s) if steps.size > 1]
    usual_s = [float(np.median(part)) for part in steps_s]
    steady = [
        float(np.mean(np.abs(part - step_s) <= 0.1 * step_s)) for part, step_s in zip(steps_s, usual_s, strict=True)
    ]
    covered = [part.size * step_s / float(part.sum()) for part, step_s in zip(steps_s, usual_s, strict=True)]
    rate = [f"# a tag is stored every {np.median(usual_s):g} s, in the median"] if usual_s else []
    if not steady or (float(np.median(steady)) >= _STEADY and min(covered) >= _STEADY * max(covered)):
        series = (np.concatenate(one.seen.numbers) for one in signals if one.guess.quantity in _OF_RUNS)
        if usual_s and looks_like_means(series, float(np.median(usual_s))):
            assumed["value"] = f"mean: {_MEAN_WHY}"
            return [*rate, f'value = "mean"  # assumed: {_MEAN_WHY}']
        assumed["value"] = "instant"
        return [
            *rate,
            'value = "instant"  # assumed; "mean" if means are stored, of the interval that ends at the stamp',
        ]
    longest_s = max(float(part.max()) for part in steps_s)
    assumed["value"] = "held, as values are stored on change"
    return [
        *rate,
        'value = "held"  # assumed: tags are silent for a while, as when values are stored on change',
        f"max_age_s = {math.ceil(longest_s):.1f}  # assumed: the longest silence of a tag; older values are none",
    ]


def _column_lines(looked: Look, assumed: dict[str, str]) -> list[str]:
    named = {"time": looked.time, "date": looked.date, "tag": looked.tag, "value": looked.value}
    lines = [f"{key} = {_quoted(header)}" for key, header in named.items() if header]
    if looked.quality:
        met = {text.casefold(): text for text in looked.qualities}
        good = [met[word] for word in _GOOD[:-2] if word in met] or [met[word] for word in _GOOD[-2:] if word in met][
            :1
        ]
        good = good or [text for text, _ in looked.qualities.most_common(1)]
        others = [text for text, _ in looked.qualities.most_common(8) if text not in good]
        seen = f"; there is also {', '.join(map(repr, others))}" if others else ""
        lines += [f"quality = {_quoted(looked.quality)}", f"good = {_list(good)}  # assumed{seen}"]
        assumed["good"] = f"{', '.join(map(repr, good))}{seen}"
    return lines


def _signal_lines(name: str, signal: _Signal, assumed: dict[str, str]) -> list[str]:
    span = signal.seen.span
    numbers = f", values {span[0]:g} to {span[1]:g}" if span else ""
    pump = f", pump {signal.guess.pump}" if signal.guess.pump else ""
    lines = [f"tag = {_quoted(signal.tag)}  # assumed: by {signal.guess.why}{pump}{numbers}"]
    assumed[name] = f"{signal.tag!r} by {signal.guess.why}"
    if name.endswith("_running"):
        words = list(signal.seen.words)
        runs = [word for word in words if word.casefold() in RUNNING_WORDS]
        stands = [word for word in words if word.casefold() in STANDING_WORDS]
        others = [word for word in words if word not in {*runs, *stands}]
        if words:
            lines.append(
                f"true = {_list(runs)}" + (f"  # and which of {', '.join(map(repr, others))}?" if others else "")
            )
            lines.append(f"false = {_list(stands)}")
        return lines
    unit, why = _unit(name, signal, span)
    assumed[name] += f" in {unit.unit}{_because(why)}"
    lines.append(f"unit = {_quoted(unit.unit)}  # assumed{_because(why)}")
    if unit.scale != 1.0:
        lines.append(f"scale = {unit.scale!r}")
    if unit.unit in _PRESSURES and name.endswith("_head_m"):
        lines.append(
            "# offset = 0.0  # CHECK: a gauge in the discharge is not yet the head; take off the suction side, in m"
        )
    if unit.unit == "%" and name.endswith("_frequency_hz"):
        lines.append(
            "span = [0.0, 50.0]  # assumed; without it and with --station FILE it is of the nominal frequency"
        )
    elif unit.unit == "%":
        lines.append("# span = [0.0, 5.0]  # MUST BE SAID: values at 0 % and at 100 %")
    return lines


def _unit(name: str, signal: _Signal, span: tuple[float, float] | None) -> tuple[UnitGuess, str]:
    """Unit of a signal, and why it was taken."""
    house = house_unit(name)
    if signal.unit is not None and signal.unit.house in {house, ""}:
        return signal.unit, f"'{signal.seen.unit_text}' in the file" if signal.seen.unit_text else "in the header"
    high = span[1] if span else 0.0
    if name == "level_m" and high > 20.0:
        return UnitGuess("mm" if high > 1000.0 else "cm"), f"not said; values up to {high:g} are too large for metres"
    if name.endswith("_frequency_hz") and 65.0 < high <= 101.0:
        return UnitGuess("%"), f"not said; values up to {high:g} look like percent"
    return UnitGuess(house), "not said, the recording's own"


def _because(why: str) -> str:
    return f": {why}" if why else ""


def _station_name(path: Path) -> str:
    stem = re.sub(r"[^A-Za-z0-9_.-]+", "-", path.name.split(".")[0]).strip("-_.")
    return stem[:64] or "station"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _list(texts: Sequence[str]) -> str:
    return f"[{', '.join(map(_quoted, texts))}]"
