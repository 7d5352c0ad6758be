"""Units as people write them in headers, unit lines and unit columns."""

import re
from dataclasses import dataclass

from wetwell.protocols.units import FACTORS

_SPELLINGS = {
    "m": "m meter metre metri mh2o mws mwc mca mvp mvs",
    "cm": "cm cmh2o cmws",
    "mm": "mm mmh2o mmws",
    "ft": "ft feet foot",
    "kPa": "kpa",
    "Pa": "pa",
    "bar": "bar barg baar",
    "mbar": "mbar",
    "psi": "psi psig",
    "m³/h": "m3/h m3h cbm/h cmh m3/t",
    "m³/s": "m3/s m3s cms",
    "m³/min": "m3/min m3min",
    "m³/d": "m3/d m3d m3/day m3/tag m3/vrk m3/jour",
    "l/s": "l/s ls lps l/sec",
    "l/min": "l/min lmin lpm",
    "l/h": "l/h",
    "ML/d": "ml/d mld megal/d",
    "gpm": "gpm usgpm gal/min",
    "Hz": "hz",
    "kW": "kw",
    "W": "w",
    "MW": "mw",
    "hp": "hp",
    "%": "% pct percent prozent",
}
_UNIT_OF = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings.split()}
_MGD_ML_D = 3.785411784
_ENDS = re.compile(r"[_ .](m3h|m3/h|m³/h|lps|l/s|cm|mm|m|hz|kw|bar|mbar|kpa|psi|gpm|mgd|%)$", flags=re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class UnitGuess:
    """A unit of the gateway's table, or "%", and a factor before it for a unit that the table does not have."""

    unit: str
    scale: float = 1.0

    @property
    def house(self) -> str:
        """Unit of the recording that it is turned into; empty for "%"."""
        return next((house for house, known in FACTORS.items() if self.unit in known), "")


def unit_of(text: str) -> UnitGuess | None:
    """Unit that a text is; None if it is none that a recording takes.

    Examples
    --------
    >>> unit_of("m^3/hr"), unit_of("L/s"), unit_of("m3/15 min"), unit_of("A")
    (UnitGuess(unit='m³/h', scale=1.0), UnitGuess(unit='l/s', scale=1.0), UnitGuess(unit='m³/h', scale=4.0), None)
    """
    short = re.sub(r"[\s^·]", "", text.strip().lower().replace("³", "3").replace("hr", "h"))
    interval = re.fullmatch(r"m3/(\d+)min", short)
    if interval and int(interval[1]):
        return UnitGuess("m³/h", 60.0 / int(interval[1]))
    if short == "mgd":
        return UnitGuess("ML/d", _MGD_ML_D)
    unit = _UNIT_OF.get(short)
    return None if unit is None else UnitGuess(unit)


def unit_in(header: str) -> UnitGuess | None:
    """Unit in a header: in brackets, or at its end.

    Examples
    --------
    >>> unit_in("Füllstand [cm]").unit, unit_in("pump1_flow_m3h").unit, unit_in("LT01") is None
    ('cm', 'm³/h', True)
    """
    inside = re.findall(r"[\[(]([^\])]*)[\])]", header)
    found = next(filter(None, map(unit_of, reversed(inside))), None)
    end = _ENDS.search(header.strip())
    return found or (unit_of(end[1]) if end else None)
