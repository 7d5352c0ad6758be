"""A rising main of a station file."""

from typing import Any, Literal, Self

from pydantic import model_validator

from wetwell.protocols.station.table import Finite, Label, NonNegative, Table

DEFAULT_STATIC_HEAD_M = 2.0
"""Static head of a main of which the file says nothing: the paper's. [m]"""


class RisingMain(Table):
    r"""System curve of a main, with the water at level L in the wet well.

    $$H = H_s(L) + k Q^2, \qquad H_s(L) = H_s \text{ or } L_d - L$$

    Parameters
    ----------
    name : str, optional
        What people call it, and by what a pump names its main.
    static_head_m : float, optional
        H_s, where it is taken as fixed. [m]
    delivery_level_m : float, optional
        L_d, level to which the main lifts, counted from where the levels of the wet well are. [m]
    friction_h2_m5 : float
        k of the friction k Q², with Q in m³/h. [h²/m⁵]
    layout : str
        "individual": each pump has a pipe of its own; "common": they share it.
    """

    name: Label | None = None
    static_head_m: NonNegative | None = None
    delivery_level_m: Finite | None = None
    friction_h2_m5: NonNegative = 6.0e-4
    layout: Literal["individual", "common"] = "individual"

    @model_validator(mode="before")
    @classmethod
    def _fill_lift(cls, data: Any) -> Any:
        """Without either in the file, take the default static head."""
        if isinstance(data, dict) and data.get("static_head_m") is data.get("delivery_level_m") is None:
            return {**data, "static_head_m": DEFAULT_STATIC_HEAD_M}
        return data

    @model_validator(mode="after")
    def _check_lift(self) -> Self:
        if self.static_head_m is not None and self.delivery_level_m is not None:
            raise ValueError("give either 'static_head_m' or 'delivery_level_m'")
        return self

    @property
    def lift_at_zero_m(self) -> float:
        """Static head with the wet well at level 0. [m]."""
        if self.delivery_level_m is not None:
            return self.delivery_level_m
        return DEFAULT_STATIC_HEAD_M if self.static_head_m is None else self.static_head_m

    @property
    def level_slope(self) -> float:
        """Static head that a metre of level takes away: 1 with a delivery level, else 0."""
        return 0.0 if self.delivery_level_m is None else 1.0

    def static_head_at_m(self, level_m: float) -> float:
        """Static head with the wet well at a level; never negative. [m].

        Examples
        --------
        >>> RisingMain(delivery_level_m=30.0).static_head_at_m(1.5)
        28.5
        """
        return max(self.lift_at_zero_m - self.level_slope * level_m, 0.0)
