"""Watches wastewater pump stations and says whether a pump or the rising main is at fault.

>>> import wetwell
>>> day = wetwell.simulate("alpha", "paper", seed=7)
>>> wetwell.detect(day, "alpha").episodes[0].asset
'pump:1'

Each name is loaded when it is asked for: the import itself is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from wetwell.protocols.station.station_file import Station
    from wetwell.services.api.backtest import backtest
    from wetwell.services.api.calibration import calibrate
    from wetwell.services.api.detection import detect
    from wetwell.services.api.diagnosis import diagnose
    from wetwell.services.api.frame import read
    from wetwell.services.api.simulation import simulate

__all__ = ["Station", "__version__", "backtest", "calibrate", "detect", "diagnose", "read", "simulate"]

_HOMES = {
    "Station": "wetwell.protocols.station.station_file",
    "backtest": "wetwell.services.api.backtest",
    "calibrate": "wetwell.services.api.calibration",
    "detect": "wetwell.services.api.detection",
    "diagnose": "wetwell.services.api.diagnosis",
    "read": "wetwell.services.api.frame",
    "simulate": "wetwell.services.api.simulation",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version("wetwell")
    if name not in _HOMES:
        raise AttributeError(f"module 'wetwell' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
