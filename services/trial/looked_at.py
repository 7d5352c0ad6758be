"""Seeds whose cases somebody has looked at: no headline figure comes from them."""

import tomllib
from importlib.resources import files

from wetwell.protocols.errors import ConfigError


def reason_to_refuse(seed: int) -> str:
    """Why a seed gives no headline figure; empty if nobody has looked at its cases.

    Examples
    --------
    >>> reason_to_refuse(51004)
    'cases of versions 2 of the trial, the misses of 51005 are in docs/trial.md'
    >>> reason_to_refuse(4)
    ''
    """
    listed = tomllib.loads((files("wetwell.services.trial") / "looked_at.toml").read_text(encoding="utf-8"))
    return next((one["reason"] for one in listed["seeds"] if one["first"] <= seed <= one["last"]), "")


def check_seed(seed: int, *, is_looked_at: bool) -> None:
    """Refuse a seed that was looked at, unless it is said to be.

    Raises
    ------
    ConfigError
        Names the seed and the reason.
    """
    reason = reason_to_refuse(seed)
    if reason and not is_looked_at:
        raise ConfigError(
            f"--seed: {seed} was looked at ({reason}): take another, or --looked-at for figures that are no headline"
        )
