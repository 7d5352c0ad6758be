"""Raw numbers and words of a tag turned into values of a recording."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pyarrow.compute as pc

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.recordings.importers.mapping import TagSignal
from wetwell.protocols.recordings.importers.signals.numbers import Cells
from wetwell.protocols.recordings.importers.tables.block import texts_of
from wetwell.protocols.units import factor, house_unit

RUNNING_WORDS = frozenset(
    {
        *("on", "true", "run", "running", "started", "yes", "ein", "an", "läuft", "betrieb", "in betrieb", "ja"),
        *("marche", "en marche", "oui", "käy", "käynnissä", "päällä", "aan", "marcha", "en marcha", "marcia", "till"),
    }
)
STANDING_WORDS = frozenset(
    {
        *("off", "false", "stop", "stopped", "no", "aus", "steht", "nein", "arrêt", "à l'arrêt", "non"),
        *("seis", "pysäytetty", "pois", "uit", "nee", "paro", "parado", "arresto", "från", "nej"),
    }
)
"""Words that need no mapping; which of them were met is told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalValues:
    """Values of a signal.

    Attributes
    ----------
    values : (n,) float64
        In the unit of the recording; NaN is "no value".
    is_unread : (n,) bool
        Words that mean nothing.
    assumed : mapping of word to meaning
        Words that the mapping does not name.
    """

    values: Floats
    is_unread: Flags
    assumed: dict[str, str]


def signal_values(name: str, signal: TagSignal, cells: Cells, nominal_hz: float | None) -> SignalValues:
    """Values of a signal in the unit of the recording.

    Parameters
    ----------
    name : str
        Column of the recording.
    signal : TagSignal
    cells : Cells
        Of its tag alone.
    nominal_hz : float, optional
        Nominal frequency of its pump, for a drive in percent without span. [Hz]

    Raises
    ------
    ValueError
        If the unit is "%" and neither span nor nominal frequency say of what.
    """
    is_none = _is_one_of(cells, signal.no_value) if signal.no_value else np.zeros(len(cells.numbers), dtype=bool)
    if name.endswith("_running"):
        return _running(signal, cells, is_none)
    raw = np.where(is_none, np.nan, cells.numbers)
    raw = raw if signal.scale == 1.0 else signal.scale * raw
    if signal.unit == "%":
        low, high = signal.span or (0.0, nominal_hz)
        if high is None:
            raise ValueError(
                f"signal.{name}: unit '%' is of the nominal frequency; give --station FILE, or span = [0, 50]"
            )
        raw = low + (high - low) * raw / 100.0
    elif signal.unit not in {"", house_unit(name)}:
        raw = raw * factor(signal.unit, house_unit(name))
    values = raw + signal.offset if signal.offset else raw
    return SignalValues(
        values=np.where(np.isfinite(values), values, np.nan), is_unread=cells.is_word & ~is_none, assumed={}
    )


def _running(signal: TagSignal, cells: Cells, is_none: Flags) -> SignalValues:
    """1 running, 0 standing, NaN unknown."""
    words, place_of = _words(cells)
    true, false = ({plain(word) for word in said} for said in (signal.true, signal.false))
    meanings = np.full(len(words), np.nan)
    assumed: dict[str, str] = {}
    for place, word in enumerate(words):
        said = plain(word)
        number = _as_number(said)
        if true:
            stands = said in false if false else True
            meanings[place] = 1.0 if said in true else 0.0 if stands else np.nan
            if said not in true and not false:
                assumed[word] = "stands"
        elif number is not None:
            meanings[place] = float(signal.scale * number + signal.offset > 0.0)
        elif said in RUNNING_WORDS | STANDING_WORDS:
            meanings[place] = float(said in RUNNING_WORDS)
            assumed[word] = "runs" if said in RUNNING_WORDS else "stands"
    is_known = ~(cells.is_empty | is_none)
    values = np.where(is_known, meanings[place_of], np.nan)
    met = {words[place] for place in np.unique(place_of[is_known]).tolist()}
    return SignalValues(
        values=values,
        is_unread=is_known & np.isnan(values),
        assumed={word: meaning for word, meaning in assumed.items() if word in met},
    )


def _is_one_of(cells: Cells, said: Iterable[str]) -> Flags:
    words, place_of = _words(cells)
    none = {plain(word) for word in said}
    return np.array([plain(word) in none for word in words], dtype=bool)[place_of]


def _words(cells: Cells) -> tuple[list[str], Integers]:
    """Different texts of the cells, and which of them each is."""
    encoded = pc.fill_null(texts_of(cells.column), "").dictionary_encode()
    return encoded.dictionary.to_pylist(), encoded.indices.to_numpy()


def _as_number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def plain(word: str) -> str:
    """A word without regard to capitals, a number without regard to decimals.

    Examples
    --------
    >>> plain("EIN"), plain("1.0"), plain("1,00"), plain("192")
    ('ein', '1', '1', '192')
    """
    number = _as_number(word.strip().replace(",", "."))
    return word.strip().casefold() if number is None else f"{number:.15g}"
