"""Columns of a user beside the signals of the station: rain, level of the river, tide, temperature."""

import re

COVARIATE_PREFIX = "covariate_"
"""How such a column of a recording begins; what follows is its name."""
COVARIATE_PATTERN = r"^[a-z][a-z0-9_]{0,47}$"
"""Of the name: small letters, digits and underscores, best with the unit at its end, such as `rain_mm_h`."""


def covariate_of(column: str) -> str | None:
    """Name of a covariate in the header of its column, None for another column.

    Examples
    --------
    >>> covariate_of("covariate_rain_mm_h"), covariate_of("level_m"), covariate_of("covariate_Rain")
    ('rain_mm_h', None, None)
    """
    name = column.removeprefix(COVARIATE_PREFIX)
    return name if name != column and re.match(COVARIATE_PATTERN, name) else None
