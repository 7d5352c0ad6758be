"""Tables of TOML files: frozen, checked to the last key, with the kinds of values that stand in them."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Fraction = Annotated[float, Field(gt=0, le=1)]
Label = Annotated[
    str,
    Field(
        pattern=r"^[^\s\p{C}]([^\p{C}]*[^\s\p{C}])?$",
        max_length=32,
        json_schema_extra={"pattern": r"^\S(.*\S)?$"},  # not every reader of schemas knows classes of Unicode
    ),
]
"""What people call a thing: printable, no blanks at its ends."""


class Table(BaseModel):
    """Base of the tables of a TOML file: frozen, an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")
