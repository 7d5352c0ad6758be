"""What all parts of a report have in common."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict

Short = Annotated[float, AfterValidator(lambda value: float(f"{value:.6g}"))]
"""A number of six digits: nobody needs more."""
Interval = tuple[float, float]
ShortInterval = tuple[Short, Short]


class ReportPart(BaseModel):
    """A part of a report: it does not change, and has no other keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)
