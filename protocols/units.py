"""Units in which instruments tell level, flow, head, frequency and power, and their size in house units."""

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

_HEAD_OF_KPA_M = 1000.0 / (1000.0 * 9.81)  # p / (rho g) of water with 1000 kg/m³

FACTORS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "m": {
            "m": 1.0,
            "cm": 0.01,
            "mm": 0.001,
            "ft": 0.3048,
            "in": 0.0254,
            "kPa": _HEAD_OF_KPA_M,
            "Pa": _HEAD_OF_KPA_M / 1000.0,
            "bar": _HEAD_OF_KPA_M * 100.0,
            "mbar": _HEAD_OF_KPA_M / 10.0,
            "psi": _HEAD_OF_KPA_M * 6.894757,
        },
        "m³/h": {
            "m³/h": 1.0,
            "m3/h": 1.0,
            "m³/s": 3600.0,
            "m3/s": 3600.0,
            "m³/min": 60.0,
            "m3/min": 60.0,
            "m³/d": 1.0 / 24.0,
            "m3/d": 1.0 / 24.0,
            "L/s": 3.6,
            "l/s": 3.6,
            "L/min": 0.06,
            "l/min": 0.06,
            "L/h": 0.001,
            "l/h": 0.001,
            "ML/d": 1000.0 / 24.0,
            "gpm": 0.2271247,
        },
        "Hz": {"Hz": 1.0},
        "kW": {"kW": 1.0, "W": 0.001, "MW": 1000.0, "hp": 0.7456999},
        "s": {"s": 1.0, "ms": 0.001},
        "": {"": 1.0},
    }
)
"""For each house unit: the units that are understood, and the size of one of them. Pressures are heads of water."""

_HOUSE_UNITS = {"_m3h": "m³/h", "_m": "m", "_hz": "Hz", "_kw": "kW", "_s": "s"}


@lru_cache(maxsize=1024)
def house_unit(name: str) -> str:
    """Unit of a value by the suffix of its name; empty for a plain number.

    Examples
    --------
    >>> house_unit("pump1_flow_m3h"), house_unit("level_m"), house_unit("heartbeat")
    ('m³/h', 'm', '')
    """
    return next((unit for suffix, unit in _HOUSE_UNITS.items() if name.endswith(suffix)), "")


def factor(unit: str, house: str) -> float:
    """Size of a unit in the unit of the house.

    Raises
    ------
    ValueError
        If the one cannot be turned into the other; names those that can.

    Examples
    --------
    >>> factor("L/s", "m³/h"), round(factor("bar", "m"), 4)
    (3.6, 10.1937)
    """
    known = FACTORS[house]
    if unit not in known:
        allowed = ", ".join(known) or "none"
        raise ValueError(
            f"unit: got '{unit}', must be one of {allowed}" if house else f"unit: got '{unit}', has none"
        )
    return known[unit]
