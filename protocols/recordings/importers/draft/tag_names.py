"""Which signal a tag is, by its name: words of some languages and the letters of instrument tags."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from wetwell.protocols.recordings.importers.draft.unit_names import UnitGuess

_NO_SIGNAL = (
    *(
        "setpoint",
        "sollwert",
        "consigne",
        "asetus",
        "alarm",
        "störung",
        "fault",
        "trip",
        "hours",
        "stunden",
        "runtime",
    ),
    *("heures", "tunnit", "counter", "zähler", "compteur", "laskuri", "total", "summe", "sum of", "price", "rain"),
    *("regen", "sade", "vibration", "leak"),
)
_NO_SIGNAL_OF_ITS_UNIT = ("volume", "volumen", "temp", "efficiency", "current", "strom", "courant", "virta_")
"""Words of other quantities, which count unless the unit is that of a signal."""

_NO_LETTERS = frozenset(["sp", "ha", "hh", "ll", "it", "ie", "ct", "tt", "yt", "zt", "kwh"])
_QUANTITY_WORDS = {
    "inflow_m3h": (
        "inflow",
        "influent",
        "zulauf",
        "zufluss",
        "tulovirtaama",
        "tulo",
        "entrée",
        "arrivée",
        "afluente",
    ),
    "level_m": (
        *("level", "niveau", "füllstand", "fuellstand", "wasserstand", "pegel", "pinnankorkeus", "pinta", "hauteur"),
        *("nivel", "livello", "niveå", "nivå", "sumpf"),
    ),
    "flow_m3h": (
        *("flow", "durchfluss", "durchfluß", "volumenstrom", "fördermenge", "debit", "débit", "virtaama", "caudal"),
        *("portata", "debiet", "flöde"),
    ),
    "head_m": (
        "head",
        "pressure",
        "druck",
        "förderhöhe",
        "pression",
        "paine",
        "presión",
        "presion",
        "tryck",
        "nosto",
    ),
    "frequency_hz": (
        *("frequen", "frequenz", "fréquence", "taajuus", "frecuencia", "speed", "drehzahl", "vitesse", "nopeus"),
        *("velocidad", "freq", "umrichter", "varvtal"),
    ),
    "power_kw": ("power", "leistung", "puissance", "teho", "potencia", "potenza", "effekt"),
    "running": (
        *("running", "run", "betrieb", "läuft", "marche", "käy", "kaynti", "status", "state", "zustand", "marcha"),
        *("drift", "motor", "état"),
    ),
}
"""Words of each quantity; the first quantity of which a word is met counts, so that an inflow is no flow."""

_QUANTITY_LETTERS = {
    "level_m": "lt lit lic li niv lvl",
    "flow_m3h": "ft fit fic fi q",
    "head_m": "pt pit pic",
    "frequency_hz": "hz st sit sc sic spd vfd fu vsd",
    "power_kw": "kw jt jit jic",
    "running": "on ein xs ys run sts zs",
}
"""Letters of instrument tags, as in LT01."""

_QUANTITY_OF_HOUSE = {"m³/h": "flow_m3h", "Hz": "frequency_hz", "kW": "power_kw"}
_PUMP_WORD = r"(?:pumpe|pumppu|pump|pompe|pompa|bomba|pmp|pu|agg|p)"
_PUMP_NUMBER = re.compile(rf"(?:^|[^a-z0-9]){_PUMP_WORD}[\s_.#:-]*(?:no|nr|n°)?[\s_.#:-]*0*(\d+(?:\.\d+)?)(?![0-9])")
_PUMP_LATER_NUMBER = re.compile(r"(?:pump|pompe|pompa|bomba)\D*?(?<![a-z])(\d+(?:\.\d+)?)\D*$")

_NO_FLOW_OF_PUMPS = ("overflow", "überlauf", "entlast", "trop-plein", "déversoir", "ylivuoto", "bypass", "airflow")
"""Words of flows that no pump gives."""

_LOOP = re.compile(r"(?:^|[^a-z0-9])([a-z]{2,3})[\s_.#:-]*0*(\d+)(?![0-9])")
"""Letters and number of a measuring loop, as in FT-101."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TagGuess:
    """What a tag seems to be.

    Attributes
    ----------
    quantity : str
        `level_m`, `inflow_m3h`, `main1_flow_m3h`, or that of a pump such as `flow_m3h`.
    pump : str
        What the export calls its pump; empty for the station's own.
    why : str
        What it was recognised by.
    """

    quantity: str
    pump: str
    why: str


def recognise(tag: str, unit: UnitGuess | None) -> TagGuess | None:
    """What a tag is by its name and its unit; None if nothing speaks for a signal of a recording.

    Examples
    --------
    >>> recognise("PS07.LT01.PV", None).quantity, recognise("Pumpe 2 Durchfluss", None)
    ('level_m', TagGuess(quantity='flow_m3h', pump='2', why="'durchfluss'"))
    >>> recognise("P1 Betriebsstunden", None) is None
    True
    """
    guess = _read(tag, unit)
    if guess.quantity in {"level_m", "inflow_m3h"}:
        return TagGuess(quantity=guess.quantity, pump="", why=guess.why)
    return guess if guess.quantity and guess.pump else None


def recognise_main_flow(tag: str, unit: UnitGuess | None) -> TagGuess | None:
    """A flow that names no pump, taken for that of the main; None for any other tag.

    Examples
    --------
    >>> recognise_main_flow("FT-100", None)
    TagGuess(quantity='main1_flow_m3h', pump='', why="'FT', which names no pump")
    >>> recognise_main_flow("Overflow", None) is recognise_main_flow("P1 flow", None) is None
    True
    """
    guess = _read(tag, unit)
    if guess.quantity != "flow_m3h" or guess.pump or any(word in tag.lower() for word in _NO_FLOW_OF_PUMPS):
        return None
    return TagGuess(quantity="main1_flow_m3h", pump="", why=f"{guess.why}, which names no pump")


def _read(tag: str, unit: UnitGuess | None) -> TagGuess:
    """Quantity and pump that a name and a unit speak of, either empty where they speak of none."""
    text = re.sub(r"([a-zäöü])([A-Z])", r"\1_\2", tag).lower()
    tokens = {re.sub(r"\d+$", "", token) for token in re.split(r"[^\w]+|_", text) if token}
    others = () if unit and unit.house in _QUANTITY_OF_HOUSE else _NO_SIGNAL_OF_ITS_UNIT
    if tokens & _NO_LETTERS or any(word in text for word in (*_NO_SIGNAL, *others)):
        return TagGuess(quantity="", pump="", why="")
    quantity, why = _quantity(text, tokens)
    of_unit = _QUANTITY_OF_HOUSE.get(unit.house) if unit else None
    if of_unit and quantity not in {of_unit, "inflow_m3h" if of_unit == "flow_m3h" else of_unit}:
        quantity, why = of_unit, f"unit {unit.unit if unit else ''}"
    match = _PUMP_NUMBER.search(text) or _PUMP_LATER_NUMBER.search(text)
    return TagGuess(quantity=quantity, pump=match[1] if match else "", why=why)


def _quantity(text: str, tokens: set[str]) -> tuple[str, str]:
    for quantity, words in _QUANTITY_WORDS.items():
        word = next((word for word in words if word in text), None)
        if word is not None:
            return quantity, f"'{word}'"
    for quantity, letters in _QUANTITY_LETTERS.items():
        met = sorted(tokens & set(letters.split()))
        if met:
            return quantity, f"'{met[0].upper()}'"
    return "", ""


def of_loops(tags: Iterable[str]) -> dict[str, TagGuess]:
    """Tags of pumps that have no number but that of their measuring loop.

    A loop is a pump's if its letters come with two numbers or more: one flow meter alone is that of the station.

    Examples
    --------
    >>> {tag: guess.pump for tag, guess in of_loops(["FT-101", "FT-201", "PT-100", "LT-101", "LT-102"]).items()}
    {'FT-101': '101', 'FT-201': '201'}
    """
    found: dict[str, dict[str, TagGuess]] = {}
    for tag in tags:
        match = _LOOP.search(tag.lower())
        quantity, why = _quantity("", {match[1]}) if match else ("", "")
        if match and quantity and quantity != "level_m":
            guess = TagGuess(quantity=quantity, pump=match[2], why=f"{why} and the number of its loop")
            found.setdefault(match[1], {})[tag] = guess
    return {
        tag: guess
        for of_letters in found.values()
        if len({guess.pump for guess in of_letters.values()}) > 1
        for tag, guess in of_letters.items()
    }


def number_pumps(labels: set[str]) -> dict[str, int]:
    """Numbers of pumps from 1, in the order of what the export calls them.

    Examples
    --------
    >>> number_pumps({"1", "2"}), number_pumps({"1.1", "2.1", "1.2"}), number_pumps({"101", "102"})
    ({'1': 1, '2': 2}, {'1.1': 1, '1.2': 2, '2.1': 3}, {'101': 1, '102': 2})
    """
    ordered = sorted(labels, key=lambda label: [int(part) for part in label.split(".")])
    return {label: number for number, label in enumerate(ordered, start=1)}
